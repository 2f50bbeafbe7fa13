"""A first match completed: what it is unsure of is searched along epipolar lines and refined."""

from __future__ import annotations

from typing import Protocol

import numpy as np

from dfvs_core.arrays import ImageArray
from dfvs_core.correspondence import FlowField
from dfvs_core.matching.plane_sweep import plane_sweep
from dfvs_core.matching.refinement import refine
from dfvs_core.matching.sureness import sure_share, surer_of_each

NOTHING_SHARE = 0.035
"""Share of sure pixels under which a result is as good as none."""
_SETTLED_SHARE, _WHOLE_SHARE = 0.65, 0.95
"""Shares of sure pixels from which on nothing is searched a second time, or at all."""
_ON_LINES = 0.65
"""Factor on the confidence of what only a search along lines has found: as much of what is sure
is wrong then as before it."""
_LINES_SHARE = 0.15
"""Share of sure pixels that a search along lines is trusted from; less knows the lines badly."""


class Picture(Protocol):
    """A picture in colour (H, W, 3) and grey (H, W), uint8."""

    image: ImageArray
    grey: ImageArray


def search_lines(current: Picture, other: Picture, field: FlowField) -> FlowField:
    """Search what is unsure along epipolar lines, and again if that is much; refine it.

    Returns
    -------
    FlowField
        ``field``, and where that is unsure what was found.
    """
    for enough in (_WHOLE_SHARE, _SETTLED_SHARE):
        if not NOTHING_SHARE <= sure_share(field) < enough:
            break
        swept = plane_sweep(current.image, other.image, field)
        if swept is None:
            break
        found = refine(current.grey, other.grey, swept.flow)
        trust = np.float32(_ON_LINES * min(1.0, sure_share(field) / _LINES_SHARE))
        confidence = trust * found.confidence * swept.confidence
        field = surer_of_each(field, FlowField(found.flow, confidence))
    return field
