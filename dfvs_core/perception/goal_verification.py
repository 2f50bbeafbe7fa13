"""Goal verification: share of the texture in view that matches the goal image.

A repeated structure can be matched with another one of its kind. All correspondences agree on a
motion, and the error falls to nothing at a false goal. At the true goal the view is the goal
image, and nearly all of its texture matches in its place; far from it nothing is verified. The
distance is taken over the depth: a false match can make the metric scale wrong. Where some texture
is left open on arrival, another match is looked for once, between frames: repeated structures have
one, and at a false goal it explains what is left open.
"""

from dataclasses import replace

import cv2
import numpy as np

from dfvs_core.geometry.arrays import BoolArray, ImageArray
from dfvs_core.matching.config import MatchingConfig
from dfvs_core.matching.correspondence import CONFIDENT, FlowField
from dfvs_core.matching.elsewhere import SiftImage, match_elsewhere
from dfvs_core.matching.verify import has_texture
from dfvs_core.matching.warping import lands_inside
from dfvs_core.perception.channel_order import is_channel_order_swapped
from dfvs_core.servo.exchange import ServoResult, Status

NEAR_RAD = 0.05
"""Angle to the goal plus distance over depth, below which the view has to match."""

_REACHED_RAD = 2 * NEAR_RAD
"""The same above which nothing is reached, however short the metric scale makes the distance."""

PATIENCE_NS = 1_000_000_000
"""Time for which a view may not match: somebody may walk through it."""

_NOISE_SIGMA_PX = 1.5
"""Blur that removes the noise of a camera in the dark, which is no texture."""
_LEAST_TEXTURE = 0.02
"""Share of the view with texture below which nothing is verified."""
_UNCHANGED = 0.95
"""Matched texture ratio on arrival from which on no other match is looked for."""
_IN_PLACE = 3.0
"""Length of a vector, in median lengths, above which it leads to another place in the goal image.

Near the goal all are short. Those of close surfaces and of a tilted camera are longer.
"""
_EXPLAINED = 0.2
"""Share of the texture left open that another match has to explain to be the better one."""
_EXPLAINED_OF_ALL = 0.03
"""The same of all texture: a small area may be explained by chance."""


def matched_texture_ratio(image: ImageArray, flow: FlowField) -> float:
    """Share of the texture of a view that is confidently matched in place; 1 without texture.

    Parameters
    ----------
    image, flow : (H, W, 3) uint8, FlowField
        The view, at the size of the flow, and that to the goal image.
    """
    textured = _textured(image)
    if textured.mean() < _LEAST_TEXTURE:
        return 1.0
    confident = textured & (flow.confidence > CONFIDENT)
    if not confident.any():
        return 0.0
    lengths = np.linalg.norm(flow.flow[confident], axis=1)
    longest = MatchingConfig().same_px + _IN_PLACE * np.median(lengths)
    return float(np.count_nonzero(lengths < longest) / np.count_nonzero(textured))


def _textured(image: ImageArray) -> BoolArray:
    """(H, W): whether an image (H, W, 3) has texture that is not its noise."""
    grey = cv2.GaussianBlur(cv2.cvtColor(image, cv2.COLOR_RGB2GRAY), (0, 0), _NOISE_SIGMA_PX)
    return has_texture(np.asarray(grey, np.uint8))


class GoalVerifier:
    """Refuses frames whose view is not the goal's.

    Parameters
    ----------
    goal : SiftImage
        The goal image, at the size of the flow.
    least : float
        Matched texture ratio below which a view at the goal is not the goal's; 0 refuses none.
    """

    def __init__(self, goal: SiftImage, least: float) -> None:
        self._goal, self._least = goal, least
        self._mismatch_since_ns: int | None = None
        self._view: tuple[SiftImage, FlowField] | None = None
        """View on arrival for which another match is to be looked for, and its flow."""
        self._is_elsewhere: bool | None = None
        """Whether another match explains more; None: not looked for since the vehicle came near."""

    def verify(
        self, servo: ServoResult, image: ImageArray, flow: FlowField, t_capture_ns: int
    ) -> ServoResult:
        """Result of a frame: the servo's, refused where the view is not the goal's.

        A view that counts as the goal and does not match its image has not reached it; after
        ``PATIENCE_NS`` it is a false goal. So it is as soon as :meth:`compare` has found another
        match that explains more; nothing is reached before it was called.
        ``image`` (H, W, 3) uint8 is the view, at the size of the flow to the goal image.
        """
        if servo.status is not Status.OK:
            self._mismatch_since_ns = None
            return servo
        if is_channel_order_swapped(image, self._goal.image, flow):
            return _refused(servo, Status.SWAPPED_CHANNELS)
        away_rad = servo.error_rad + servo.distance_over_depth
        if servo.reached and away_rad >= _REACHED_RAD:
            servo = replace(servo, reached=False)
        if away_rad >= NEAR_RAD and not servo.reached:
            self._forget()
            return servo
        if self._is_elsewhere:
            self._forget()
            return _refused(servo, Status.FALSE_GOAL)
        ratio = matched_texture_ratio(image, flow)
        if ratio >= self._least:
            self._mismatch_since_ns = None
            is_settled = ratio >= _UNCHANGED or self._is_elsewhere is False or self._least == 0.0
            if is_settled or not servo.reached:
                return servo
            self._view = self._view or (SiftImage(image, MatchingConfig()), flow)
            return replace(servo, reached=False)
        if self._mismatch_since_ns is None:
            self._mismatch_since_ns = t_capture_ns
        if t_capture_ns - self._mismatch_since_ns < PATIENCE_NS:
            return replace(servo, reached=False)
        self._forget()
        return _refused(servo, Status.FALSE_GOAL)

    @property
    def is_comparing(self) -> bool:
        """Whether a step of :meth:`compare` was done, and one is still to be done."""
        return self._view is not None and self._view[0].has_features

    def compare(self) -> bool:
        """A step of looking for another match; whether there was one to do."""
        if self._view is None:
            return False
        view, flow = self._view
        if not view.prepare():
            self._is_elsewhere, self._view = self._is_better_elsewhere(view, flow), None
        return True

    def _forget(self) -> None:
        self._mismatch_since_ns = self._view = self._is_elsewhere = None

    def _is_better_elsewhere(self, view: SiftImage, flow: FlowField) -> bool:
        """Whether another match explains what this one leaves open of what both have in view.

        What is new in a view, or was moved, has no other match with all around it.
        """
        other = match_elsewhere(view, self._goal, flow, MatchingConfig())
        if other is None:
            return False
        textured = _textured(view.image)
        is_open = textured & lands_inside(other.flow) & (flow.confidence <= CONFIDENT)
        explained = np.count_nonzero(is_open & (other.confidence > CONFIDENT))
        least = _EXPLAINED * is_open.sum(), _EXPLAINED_OF_ALL * textured.sum()
        return bool(explained > max(least))


def _refused(servo: ServoResult, status: Status) -> ServoResult:
    zero_velocity = np.zeros_like(servo.velocity)
    return replace(servo, status=status, velocity=zero_velocity, reached=False)
