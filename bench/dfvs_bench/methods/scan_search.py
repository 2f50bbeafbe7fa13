"""The product on a camera that looks around where it does not find the goal.

Of a goal that is a fifth in view, most is seen once the camera has turned; and one that was taken
for another place is found from where the way began. The service does nothing of the kind: a
vehicle stands still while it sees no goal, and turning it is the pilot's part.
"""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np

from dfvs_bench.methods.dfvs import MAX_SPEED_M_S, MAX_TURN_RAD_S, PipelineMethod
from dfvs_bench.methods.method import FRAME_PERIOD_S, Decision, GoalObservation, Observation
from dfvs_bench.report.panorama import Look, Panorama, outer_ring, ring
from dfvs_core.geometry.arrays import FloatArray
from dfvs_core.geometry.poses import invert_pose, make_pose, se3_exp, se3_log
from dfvs_core.matching.correspondence import confident_ratio
from dfvs_core.matching.matcher import Matcher

ITERATIONS = 300

_NOWHERE = "the goal is not seen in any direction"
_ARRIVED = 1e-6


class SearchingMethod:
    """Leads as the pipeline does; where that loses the goal, goes back and looks around.

    Nine looks are taken from where the way began. The best of those that agree with each other is
    followed; where that fails as well, the next best. Where a place did not look like the goal
    once the camera was there, no look is followed that leads to the same one. Where none is left
    to follow, eight more are taken, further around.

    Parameters
    ----------
    make : callable
        Makes the pipeline anew, which remembers nothing.
    goal : GoalObservation
        Only its picture and intrinsics are used.
    matcher : Matcher
        Source of correspondences.
    """

    def __init__(
        self, make: Callable[[], PipelineMethod], goal: GoalObservation, matcher: Matcher
    ) -> None:
        self._make = make
        self._matcher = matcher
        self._goal = matcher.encode(goal.image)
        self._inner = make()
        self._T_world_ahead: FloatArray | None = None
        self._to_look = ring()
        self._further = outer_ring()
        self._panorama = Panorama(goal.camera)
        self._followed: Look | None = None
        self._looks_taken = 0
        self._was_mistaken = False
        self._R_ahead_next: FloatArray | None = None
        """What is being turned to; None while servoing."""

    def decide(self, observation: Observation) -> Decision:
        """Servo, or turn on to the next look."""
        if self._T_world_ahead is None:
            self._T_world_ahead = observation.T_world_camera
        if self._R_ahead_next is None:
            decision = self._inner.decide(observation)
            if not (decision.lost or self._inner.is_mistaken):
                return decision
            self._was_mistaken = self._inner.is_mistaken
            self._R_ahead_next = self._next_direction()
        return self._turn(observation, self._T_world_ahead)

    def _turn(self, observation: Observation, T_world_ahead: FloatArray) -> Decision:
        """Move towards the next direction; where it is reached, look, or servo from there."""
        while self._R_ahead_next is not None:
            T_world_next = T_world_ahead @ make_pose(self._R_ahead_next, np.zeros(3))
            twist = se3_log(invert_pose(observation.T_world_camera) @ T_world_next)
            if np.linalg.norm(twist) > _ARRIVED:
                return Decision(se3_exp(_within_limits(twist)), math.nan)
            if not self._to_look:
                self._R_ahead_next, self._inner = None, self._make()
                return self.decide(observation)
            self._look(observation)
            self._R_ahead_next = self._next_direction()
        return Decision(np.eye(4), math.nan, lost=_NOWHERE)

    def _look(self, observation: Observation) -> None:
        """Match what is seen in the direction that was due."""
        field = self._matcher.match(self._matcher.encode(observation.image), self._goal)
        look = Look(self._to_look.pop(0), field, confident_ratio(field))
        if self._looks_taken == 0:
            self._followed = look  # straight ahead: what was followed until now
        self._looks_taken += 1
        self._panorama.add(look)

    def _next_direction(self) -> FloatArray | None:
        """Where to look next; after all looks, the best that has not failed; None if none has."""
        if self._to_look:
            return self._to_look[0]
        if self._followed is not None:
            self._panorama.dismiss(self._followed, place=self._was_mistaken)
        self._followed = self._panorama.best()
        if self._followed is not None:
            return self._followed.R_ahead_look
        self._to_look, self._further = self._further, []
        return self._to_look[0] if self._to_look else None


def _within_limits(twist: FloatArray) -> FloatArray:
    """Motion (6,) m, rad within one frame, of that to where the camera shall be."""
    most = np.array([MAX_SPEED_M_S, MAX_TURN_RAD_S]) * FRAME_PERIOD_S
    lengths = np.linalg.norm(twist.reshape(2, 3), axis=1)
    return np.asarray(twist / max(1.0, float((lengths / most).max())))
