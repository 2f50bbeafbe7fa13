"""Where features say that the parts of a picture are in another one: one surface at a time.

Of the matches of a room some are on the wall, some on the floor, and some are wrong. A smooth
motion through all of them is none of theirs where they differ much; so the homography that
explains most of them is taken first (MAGSAC, Barath 2020), then that of most of the rest. Each is
a start of its own, and so is the smooth motion of them all.
"""

from __future__ import annotations

from collections.abc import Iterator

import cv2
import numpy as np

from dfvs_core.arrays import BoolArray, Float32Array
from dfvs_core.matching.features import Features, Matches, match_features
from dfvs_core.matching.motion import fit_motion

_RATIO = 0.9
_MOST_SURFACES = 3
_FEWEST_OF_SURFACE, _FEWEST_OF_ALL = 6, 8
_MISS_PX = 4.0
_CERTAINTY, _ROUNDS = 0.999, 3000


def surface_flows(
    current: Features, other: Features, size: tuple[int, int]
) -> Iterator[Float32Array]:
    """Flows (H, W, 2) from one picture to another, both of ``size`` (height, width).

    Each is right, if at all, where the matches of its surface are, and made when it is asked for.
    """
    matches = match_features(current, other, size, _RATIO)
    for surface in surfaces(matches):
        yield fit_motion(surface, size).flow()
    if len(matches) >= _FEWEST_OF_ALL:
        yield fit_motion(matches, size).flow()


def surfaces(matches: Matches) -> Iterator[Matches]:
    """Matches of each surface, the one with most of them first."""
    rest = matches
    for _ in range(_MOST_SURFACES):
        if len(rest) < _FEWEST_OF_SURFACE:
            return
        on_it = _on_one_plane(rest)
        if np.count_nonzero(on_it) < _FEWEST_OF_SURFACE:
            return
        yield Matches(rest.current[on_it], rest.other[on_it])
        rest = Matches(rest.current[~on_it], rest.other[~on_it])


def _on_one_plane(matches: Matches) -> BoolArray:
    """(N,): which matches the homography explains that explains most of them."""
    none = np.zeros(len(matches), np.bool_)
    try:
        found, mask = cv2.findHomography(
            matches.current,
            matches.other,
            cv2.USAC_MAGSAC,
            _MISS_PX,
            maxIters=_ROUNDS,
            confidence=_CERTAINTY,
        )  # which draws the same samples every time
    except cv2.error:  # no four of them make a homography
        return none
    return none if found is None else np.asarray(mask.ravel() > 0)
