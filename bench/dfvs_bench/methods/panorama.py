"""Matches of a goal image with views in several directions from one place.

Two of the views differ by a rotation alone. So no depth is needed to tell whether they saw the goal
in the same spot of the world. Right matches support each other that way, and chance seldom does so
twice.
"""

import math
from dataclasses import dataclass

import numpy as np

from dfvs_core.geometry.arrays import FloatArray
from dfvs_core.geometry.camera import CameraModel, homogeneous
from dfvs_core.geometry.poses import so3_exp
from dfvs_core.matching.correspondence import CONFIDENT, FlowField
from dfvs_core.matching.warping import pixel_grid, sample

RING_RAD = math.radians(25.0)
"""How far from straight ahead: more than half of what a camera of 90 degrees sees stays in view."""
OUTER_RING_RAD = math.radians(50.0)
"""Further out: what is seen from there hardly begins within the view straight ahead."""
_RING_COUNT = 8
_LEAST_DEPTH = 0.1
"""Of a ray of unit depth, turned: what is further aside is not in view."""
_SAME_PX = 3.0
"""Distance within which two matches lead to the same point."""
_LEAST_COMMON_RATIO, _SAME_RATIO = 0.005, 0.5
"""Share of the image on which two matches are compared, and share of that which must agree."""


def ring() -> list[FloatArray]:
    """Rotations (3, 3) of the camera to scan by: straight ahead, then once round."""
    return [np.eye(3), *_around(RING_RAD, 0.0)]


def outer_ring() -> list[FloatArray]:
    """Rotations (3, 3) to scan further around by, in directions between those of the ring."""
    return _around(OUTER_RING_RAD, 0.5)


def _around(aside_rad: float, first: float) -> list[FloatArray]:
    """Rotations aside, all around; ``first`` in steps."""
    angles = [2.0 * math.pi * (k + first) / _RING_COUNT for k in range(_RING_COUNT)]
    axes = [np.array([math.sin(a), math.cos(a), 0.0]) for a in angles]
    return [so3_exp(aside_rad * axis) for axis in axes]


@dataclass(frozen=True, slots=True, eq=False)
class ScanMatch:
    """A match with the goal image in a camera turned by ``R_ahead_view`` (3, 3), and its score."""

    R_ahead_view: FloatArray
    field: FlowField
    score: float


class Panorama:
    """Matches of views from one place; ``camera`` is theirs, and matches may be at another size."""

    def __init__(self, camera: CameraModel) -> None:
        self._camera = camera
        self._matches: list[ScanMatch] = []

    def add(self, match: ScanMatch) -> None:
        """Add a match that shows something."""
        if match.score > 0.0:
            self._matches.append(match)

    def best(self) -> ScanMatch | None:
        """Best match of the group of consistent matches with the highest total score."""
        if not self._matches:
            return None
        groups = [self._agreeing(match) for match in self._matches]
        group = max(groups, key=lambda matches: sum(match.score for match in matches))
        return max(group, key=lambda match: match.score)

    def dismiss(self, match: ScanMatch, *, place: bool) -> None:
        """Remove a match, with all that show the goal in the same ``place`` if that was wrong."""
        gone = [match, *self._agreeing(match)] if place else [match]
        self._matches = [each for each in self._matches if all(each is not other for other in gone)]

    def _agreeing(self, match: ScanMatch) -> list[ScanMatch]:
        """Matches that lead to the same points of the goal, itself first."""
        others = [each for each in self._matches if each is not match]
        turned = [self._turned(each, match.R_ahead_view) for each in others]
        pairs = zip(others, turned, strict=True)
        return [match, *(each for each, field in pairs if _are_consistent(match.field, field))]

    def _turned(self, match: ScanMatch, R_ahead_other: FloatArray) -> FlowField:
        """Flow of a match as a camera would have seen it that is turned by ``R_ahead_other``."""
        field = match.field
        size = (height, width) = field.flow.shape[:2]
        camera = self._camera.scaled(width, height)
        pixels = pixel_grid(size)
        xy = camera.normalise(pixels.astype(np.float64))
        turned = homogeneous(xy) @ (match.R_ahead_view.T @ R_ahead_other).T
        ahead = turned[..., 2] > _LEAST_DEPTH
        at = camera.project(np.where(ahead[..., None], turned, [0.0, 0.0, 1.0])).astype(np.float32)
        ahead &= ((at >= 0.0) & (at <= np.array(camera.size) - 1.0)).all(axis=-1)
        flow = sample(field.flow, at) + at - pixels
        return FlowField(flow, sample(field.confidence, at) * ahead)


def _are_consistent(first: FlowField, second: FlowField) -> bool:
    """Whether two flows lead to the same places, where both are confident."""
    both = (first.confidence > CONFIDENT) & (second.confidence > CONFIDENT)
    if np.mean(both) < _LEAST_COMMON_RATIO:
        return False
    apart = np.linalg.norm(first.flow[both] - second.flow[both], axis=1)
    return bool(np.mean(apart < _SAME_PX) > _SAME_RATIO)
