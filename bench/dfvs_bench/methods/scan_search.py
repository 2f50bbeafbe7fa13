"""The product on a camera that scans where it does not find the goal.

Of a goal that is a fifth in view, most is seen once the camera has turned; and one that was taken
for another place is found from where the way began. The service does nothing of the kind: a
vehicle stands still while it sees no goal, and turning it is the pilot's part.
"""

import math
from collections.abc import Callable

import numpy as np

from dfvs_bench.methods.dfvs import MAX_SPEED_M_S, MAX_TURN_RAD_S, PipelineMethod
from dfvs_bench.methods.method import FRAME_PERIOD_S, Decision, GoalObservation, Observation
from dfvs_bench.methods.panorama import Panorama, ScanMatch, outer_ring, ring
from dfvs_core.geometry.arrays import FloatArray
from dfvs_core.geometry.poses import invert_pose, make_pose, se3_exp, se3_log
from dfvs_core.matching.correspondence import confident_ratio
from dfvs_core.matching.matcher import Matcher

ITERATIONS = 300

_NOWHERE = "the goal is not seen in any direction"
_ARRIVED = 1e-6


class ScanSearchMethod:
    """Leads as the pipeline does; where that loses the goal, goes back and scans.

    Nine views are matched from where the initial motion began. The best of the matches that agree
    with each other is followed; where that fails as well, the next best. Where a place did not
    look like the goal once the camera was there, no match that leads to it is followed. Where none
    is left to follow, eight more views are matched, further around.

    ``make`` makes the pipeline anew, which remembers nothing. Of the goal only image and intrinsics
    are used.
    """

    def __init__(
        self, make: Callable[[], PipelineMethod], goal: GoalObservation, matcher: Matcher
    ) -> None:
        self._make = make
        self._matcher = matcher
        self._goal = matcher.encode(goal.image)
        self._inner = make()
        self._T_world_ahead: FloatArray | None = None
        self._directions = ring()
        self._further = outer_ring()
        self._panorama = Panorama(goal.camera)
        self._followed: ScanMatch | None = None
        self._views_matched = 0
        self._was_false_goal = False
        self._R_ahead_next: FloatArray | None = None
        """What is being turned to; None while servoing."""

    def decide(self, observation: Observation) -> Decision:
        """Servo, or turn on to the next view."""
        if self._T_world_ahead is None:
            self._T_world_ahead = observation.T_world_camera
        if self._R_ahead_next is None:
            decision = self._inner.decide(observation)
            if not (decision.lost or self._inner.is_false_goal):
                return decision
            self._was_false_goal = self._inner.is_false_goal
            self._R_ahead_next = self._next_direction()
        return self._turn(observation, self._T_world_ahead)

    def _turn(self, observation: Observation, T_world_ahead: FloatArray) -> Decision:
        """Move towards the next direction; where it is reached, match the view, or servo."""
        while self._R_ahead_next is not None:
            T_world_next = T_world_ahead @ make_pose(self._R_ahead_next, np.zeros(3))
            twist = se3_log(invert_pose(observation.T_world_camera) @ T_world_next)
            if np.linalg.norm(twist) > _ARRIVED:
                return Decision(se3_exp(_within_limits(twist)), math.nan)
            if not self._directions:
                self._R_ahead_next, self._inner = None, self._make()
                return self.decide(observation)
            self._match_view(observation)
            self._R_ahead_next = self._next_direction()
        return Decision(np.eye(4), math.nan, lost=_NOWHERE)

    def _match_view(self, observation: Observation) -> None:
        """Match what is seen in the direction that was due."""
        field = self._matcher.match(self._matcher.encode(observation.image), self._goal)
        match = ScanMatch(self._directions.pop(0), field, confident_ratio(field))
        if self._views_matched == 0:
            self._followed = match  # straight ahead: what was followed until now
        self._views_matched += 1
        self._panorama.add(match)

    def _next_direction(self) -> FloatArray | None:
        """Next direction; after all of them, that of the best match that has not failed, if any."""
        if self._directions:
            return self._directions[0]
        if self._followed is not None:
            self._panorama.dismiss(self._followed, place=self._was_false_goal)
        self._followed = self._panorama.best()
        if self._followed is not None:
            return self._followed.R_ahead_view
        self._directions, self._further = self._further, []
        return self._directions[0] if self._directions else None


def _within_limits(twist: FloatArray) -> FloatArray:
    """Motion (6,) m, rad within one frame, of that to where the camera shall be."""
    most = np.array([MAX_SPEED_M_S, MAX_TURN_RAD_S]) * FRAME_PERIOD_S
    lengths = np.linalg.norm(twist.reshape(2, 3), axis=1)
    return np.asarray(twist / max(1.0, float((lengths / most).max())))
