"""Correspondences with the goal, frame after frame, by what the last good frame showed.

Two guesses lead to the goal's points without a search: the flow of that frame, and the flow that
its pose and depth foretell. The former is exact where it was sure; the latter reaches on to what
comes into view, and bridges a second without any goal in sight. Both would take twice the time:
a frame goes by the former where it can, and the latter is tried when nobody waits.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from dfvs_core.arrays import FloatArray
from dfvs_core.camera import CameraModel
from dfvs_core.correspondence import DepthMap, FlowField
from dfvs_core.depth.prediction import predict_flow
from dfvs_core.matching.matcher import Matcher, Prepared
from dfvs_core.matching.merit import agree
from dfvs_core.matching.sureness import sure_share, surer_of_each
from dfvs_core.poses import invert_pose
from dfvs_core.wrong_places import WrongPlaces

GUESS_NS = 1_500_000_000
"""How long a search goes by a good frame; a vehicle that sees no goal brakes."""

_GUESSED_SEARCHES = 2
"""Searches by a good frame that may fail before one goes by nothing: that takes longer."""

TRIED_NS = 15_000_000_000
"""How long a good frame is tried before a search: on a slow computer a search takes seconds."""

PASS_OVER_NS = 60_000_000
"""A first lost frame is passed over if it comes this soon after the last good one.

Of a slower camera the one after it would be searched too late: the gate holds a quarter of a second
after a good frame.
"""

_SCANT_SHARE, _MORE_LOOKS = 0.25, 4
"""Share of sure pixels below which it is looked again while nobody flies, and how often."""

_CLEAR_SHARE = 0.45
"""Share of sure pixels from which on the flow of a frame is guess enough for the next."""


@dataclass(frozen=True, slots=True)
class GoodLook:
    """A frame in which the goal was seen.

    ``T_goal_current`` (4, 4) is the camera's estimated pose in the goal's camera, and
    ``T_world_camera`` (4, 4) where the vehicle's odometry had it, m.
    """

    t_capture_ns: int
    flow: FlowField
    T_goal_current: FloatArray
    T_world_camera: FloatArray


class GoalTracker:
    """Matches frames with one goal, and remembers the last good look at it.

    Parameters
    ----------
    matcher : Matcher
        Source of dense correspondences.
    goal : Prepared
        The goal's picture.
    camera, goal_camera : CameraModel
        Of the frames and of the goal's picture.
    stride_px : int
        Grid of the depth maps.
    """

    def __init__(
        self,
        matcher: Matcher,
        goal: Prepared,
        camera: CameraModel,
        goal_camera: CameraModel,
        stride_px: int,
    ) -> None:
        self._matcher, self._goal = matcher, goal
        self._camera, self._goal_camera, self._stride_px = camera, goal_camera, stride_px
        self._last: GoodLook | None = None
        self._is_lost = False
        self._failed = 0
        """Searches by the last good frame since then."""
        self._looks_left = _MORE_LOOKS
        self._wrong = WrongPlaces(camera, goal_camera, stride_px)
        self._passed_over = False
        """Whether the last search passed over the wrong places, and nothing was found since."""

    def remember(self, look: GoodLook | None) -> None:
        """Keep the last frame that showed the goal; None: the frame that was matched did not."""
        self._is_lost = look is None
        if look is not None:
            self._last, self._failed, self._passed_over = look, 0, False

    def forget(self, is_wrong: bool) -> None:
        """Begin anew: what was seen was not the goal. ``is_wrong``: it was flown to."""
        last = self._last
        if last is not None and is_wrong:
            T_world_goal = last.T_world_camera @ invert_pose(last.T_goal_current)
            self._wrong.add(T_world_goal, last.t_capture_ns)
        self._last, self._failed = None, 0

    def match(
        self,
        prepared: Prepared,
        t_capture_ns: int,
        T_world_camera: FloatArray,
        depth: DepthMap | None,
    ) -> FlowField:
        """Flow from a frame to the goal.

        One frame that does not follow is nothing yet, be it for noise, and comes without any
        confidence; the search begins at the second one in a row: it takes several frames' time. A
        slow camera leaves no time for that (``PASS_OVER_NS``). It goes by the last good frame
        twice, and then by nothing.

        Parameters
        ----------
        prepared : Prepared
            The frame.
        t_capture_ns : int
            When it was taken.
        T_world_camera : (4, 4)
            Where, by the vehicle's odometry, m.
        depth : DepthMap, optional
            Of the frame before, on the grid.
        """
        last = self._last
        if last is None or t_capture_ns - last.t_capture_ns > TRIED_NS:
            return self._search(prepared, t_capture_ns, T_world_camera, depth)
        flow = self._matcher.track(prepared, self._goal, last.flow)
        if flow is None and depth is not None:
            T_last_current = invert_pose(last.T_world_camera) @ T_world_camera
            flow = self._foretell(prepared, last.T_goal_current @ T_last_current, depth)
        if flow is not None:
            return flow
        since_ns = t_capture_ns - last.t_capture_ns
        if since_ns > GUESS_NS or self._failed >= _GUESSED_SEARCHES:
            return self._search(prepared, t_capture_ns, T_world_camera, depth)
        if self._is_lost or since_ns > PASS_OVER_NS:
            self._failed += 1
            return self._matcher.match(prepared, self._goal, last.flow)
        return FlowField(last.flow.flow, np.zeros_like(last.flow.confidence))

    def _search(
        self,
        prepared: Prepared,
        t_capture_ns: int,
        T_world_camera: FloatArray,
        depth: DepthMap | None,
    ) -> FlowField:
        """Flow found by nothing: besides the wrong places, and if that fails anywhere."""
        self._looks_left = _MORE_LOOKS
        besides: list[FlowField] = []
        if depth is not None and not self._passed_over:
            besides = self._wrong.flows(T_world_camera, t_capture_ns, depth)
        self._passed_over = bool(besides)
        return self._matcher.match(prepared, self._goal, besides=besides)

    def look_again(self, prepared: Prepared, t_capture_ns: int) -> bool:
        """Search the last frame anew, if it was good and showed little, and add what agrees.

        Noise decides on what a search finds where little is to be found; tracking keeps it. So a
        few frames are searched, as long as nobody flies by them.

        Parameters
        ----------
        prepared : Prepared
            The same frame that was matched last, taken at ``t_capture_ns``.

        Returns
        -------
        bool
            Whether it was tried.
        """
        last = self._last
        if last is None or last.t_capture_ns != t_capture_ns or not self._looks_left:
            return False
        if sure_share(last.flow) >= _SCANT_SHARE:
            return False
        self._looks_left -= 1
        flow = self._matcher.match(prepared, self._goal)
        if agree(flow, last.flow):
            self._last = replace(last, flow=surer_of_each(flow, last.flow))
        return True

    def reconsider(self, prepared: Prepared, t_capture_ns: int, depth: DepthMap) -> bool:
        """See more of the goal in the last frame, if it was good: pose and depth may lead to more.

        Parameters
        ----------
        prepared : Prepared
            The same frame that was matched last, taken at ``t_capture_ns``.
        depth : DepthMap
            Of it, on the grid.

        Returns
        -------
        bool
            Whether it was tried: much of the frame was unsure.
        """
        last = self._last
        if last is None or last.t_capture_ns != t_capture_ns:
            return False
        if sure_share(last.flow) >= _CLEAR_SHARE:
            return False
        flow = self._foretell(prepared, last.T_goal_current, depth)
        if flow is not None and sure_share(flow) > sure_share(last.flow):
            self._last = replace(last, flow=flow)
        return True

    def _foretell(
        self, prepared: Prepared, T_goal_current: FloatArray, depth: DepthMap
    ) -> FlowField | None:
        """Flow tracked from where pose and depth foretell it."""
        guess = predict_flow(
            self._camera, depth, self._stride_px, T_goal_current, self._goal_camera
        )
        return self._matcher.track(prepared, self._goal, guess)
