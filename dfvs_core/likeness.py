"""Whether a place that counts as the goal looks like the goal picture.

Of two windows that are alike, one can be matched with the other. All correspondences agree on a
motion then, the vehicle flies it, and the error falls to nothing, metres from the goal. But at the
goal the view is the goal picture, and all that has texture in it fits; at such a place little
does. Far from the goal nothing can be said: only a part of the view shows it.
"""

from __future__ import annotations

from dataclasses import replace

import cv2
import numpy as np

from dfvs_core.arrays import ImageArray
from dfvs_core.correspondence import FlowField
from dfvs_core.matching.texture import has_texture
from dfvs_core.servo.exchange import ServoResult, Verdict

NEAR_RAD = 0.05
"""Angle to the goal, and distance over depth, that together bring as much of a change of the view:
where they are less, the view should be the goal picture."""

PATIENCE_NS = 1_000_000_000
"""So long somebody may walk through the view."""

_SURE = 0.5
_NOISE_SIGMA_PX = 1.5
"""Noise of a camera in the dark is no texture, and gone once the view is blurred by this."""
_LEAST_TEXTURE = 0.02
"""Share of the view with texture below which it says nothing."""


def likeness(image: ImageArray, flow: FlowField) -> float:
    """Share of what has texture in a view that is surely matched; 1 where nothing has.

    Parameters
    ----------
    image : (H, W, 3) uint8
        The view.
    flow : FlowField
        From it to the goal picture.
    """
    grey = cv2.GaussianBlur(cv2.cvtColor(image, cv2.COLOR_RGB2GRAY), (0, 0), _NOISE_SIGMA_PX)
    textured = has_texture(np.asarray(grey, np.uint8))
    if textured.mean() < _LEAST_TEXTURE:
        return 1.0
    return float(np.mean(flow.confidence[textured] > _SURE))


class PlaceWatch:
    """Doubts frames that count as the goal and do not look like it.

    Parameters
    ----------
    least : float
        Likeness under which a place is not the goal; 0: none is doubted.
    """

    def __init__(self, least: float) -> None:
        self._least = least
        self._unlike_since_ns: int | None = None

    def judge(
        self, result: ServoResult, image: ImageArray, flow: FlowField, t_capture_ns: int
    ) -> ServoResult:
        """Result of a frame, not reached where the view is unlike; a mistake if it stays so."""
        if result.verdict is not Verdict.OK:
            return result
        if not _is_near(result) or likeness(image, flow) >= self._least:
            self._unlike_since_ns = None
            return result
        if self._unlike_since_ns is None:
            self._unlike_since_ns = t_capture_ns
        if t_capture_ns - self._unlike_since_ns < PATIENCE_NS:
            return replace(result, reached=False)
        self._unlike_since_ns = None
        nothing = np.zeros_like(result.velocity)
        return replace(result, verdict=Verdict.MISTAKEN, velocity=nothing, reached=False)


def _is_near(result: ServoResult) -> bool:
    """Tell whether by its own account a frame was taken so near that it looks like the goal."""
    return result.error_rad + result.distance_over_depth < NEAR_RAD
