"""What speaks for a match as a whole, to choose between several of the same two pictures.

Repeated patterns and chance match small parts of pictures, and are as sure of them as of anything.
A right match tells itself from these by three things: it fills much of both pictures; of what its
motion would have in both, it leaves little texture unmatched; and it agrees on epipolar lines, as
every motion of a camera through a still room does.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import cv2
import numpy as np

from dfvs_core.arrays import BoolArray
from dfvs_core.correspondence import FlowField
from dfvs_core.matching.epipolar import fit_epipolar
from dfvs_core.matching.motion import motion_of
from dfvs_core.matching.sureness import only, sure_share, surer_of_each
from dfvs_core.matching.warping import landing_places, lands_inside

CLEAR_MERIT = 0.12
"""From here on all of 71 matches of 113 pairs were right."""
_SURE = 0.5
_UNEXPLAINED = 0.5
"""Factor for what agrees on no epipolar lines."""
_HOLES_PX = 9
_LEAST_COMMON_SHARE = 0.005
"""Of the picture, of which two matches must be sure to be compared."""
_SAME_PX, _SAME_SHARE = 3.0, 0.5
"""How near two matches lead to each other that agree, and of how much of what they share."""


@dataclass(frozen=True, slots=True)
class Candidate:
    """A match, and what speaks for it, 0 to 1."""

    field: FlowField
    merit: float


def assessed(field: FlowField, textured: BoolArray) -> Candidate:
    """Return a match with its merit; see :func:`merit_of`."""
    return Candidate(field, merit_of(field, textured))


def best_of(candidates: Iterable[Candidate]) -> Candidate | None:
    """Return the one of most merit; those after a clear one are not even asked for."""
    best: Candidate | None = None
    for candidate in candidates:
        if best is None or candidate.merit > best.merit:
            best = candidate
        if best.merit >= CLEAR_MERIT:
            break
    return best


def joined(candidates: Iterable[Candidate]) -> FlowField:
    """Return the match of most merit, with what those add that agree with it."""
    best, *others = sorted(candidates, key=lambda candidate: candidate.merit, reverse=True)
    field = best.field
    for other in others:
        if agree(best.field, other.field):
            field = surer_of_each(field, other.field)
    return field


def agree(first: FlowField, second: FlowField) -> bool:
    """Whether two matches lead to the same places, where both are sure."""
    both = (first.confidence > _SURE) & (second.confidence > _SURE)
    if np.mean(both) < _LEAST_COMMON_SHARE:
        return False
    apart = np.linalg.norm(first.flow[both] - second.flow[both], axis=1)
    return bool(np.mean(apart < _SAME_PX) > _SAME_SHARE)


def passing_over(field: FlowField, besides: Sequence[FlowField]) -> FlowField:
    """Match without confidence where it leads as one does that is known to be wrong."""
    for wrong in besides:
        field = only(field, np.linalg.norm(field.flow - wrong.flow, axis=2) >= _SAME_PX)
    return field


def merit_of(field: FlowField, textured: BoolArray) -> float:
    """Merit of a match, 0 to 1, of a picture that has texture at these pixels (H, W)."""
    motion = motion_of(field)
    if motion is None:
        return 0.0
    in_both = int(np.count_nonzero(textured & lands_inside(motion.flow())))
    explained = int(np.count_nonzero(textured & (field.confidence > _SURE)))
    fill = math.sqrt(sure_share(field) * reached_share(field))
    return agreement(field) * fill * min(1.0, explained / max(in_both, 1))


def agreement(field: FlowField) -> float:
    """Tell whether one motion of a camera explains what is sure: 1, or the half where none does."""
    return 1.0 if fit_epipolar(field) is not None else _UNEXPLAINED


def reached_share(field: FlowField) -> float:
    """Share of the other picture that the sure flow leads to."""
    holes = np.ones((_HOLES_PX, _HOLES_PX), np.uint8)
    return float(cv2.morphologyEx(landing_places(field, _SURE), cv2.MORPH_CLOSE, holes).mean())
