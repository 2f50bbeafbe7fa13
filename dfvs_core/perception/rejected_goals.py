"""Rejected false goals, excluded from relocalisation.

Of repeated structures any may be matched with the goal's. A relocalisation from the same place
would find the same one again.
"""

from __future__ import annotations

from dataclasses import dataclass, field

from dfvs_core.geometry.arrays import FloatArray
from dfvs_core.geometry.poses import pose_error

_SAME_M, _SAME_RAD = 0.3, 0.2
"""Distance within which two false goals count as one."""
_TIMES = 2
"""Rejections after which a false goal is excluded: somebody may hide the true goal once."""
_REMEMBERED_NS = 30_000_000_000
"""Time after which a rejection expires: odometry drifts."""


@dataclass(slots=True)
class _FalseGoal:
    T_world_goal: FloatArray
    t_ns: int
    times: int = 1

    def is_near(self, T_world_goal: FloatArray) -> bool:
        distance_m, angle_rad = pose_error(self.T_world_goal, T_world_goal)
        return distance_m < _SAME_M and angle_rad < _SAME_RAD

    def is_recent(self, t_ns: int) -> bool:
        return t_ns - self.t_ns <= _REMEMBERED_NS

    def is_excluded(self, t_ns: int) -> bool:
        return self.times >= _TIMES and self.is_recent(t_ns)


@dataclass(slots=True)
class RejectedGoals:
    """Rejected false goals of one goal."""

    _goals: list[_FalseGoal] = field(default_factory=list)

    def add(self, T_world_goal: FloatArray, t_ns: int) -> None:
        """Add a rejection: the goal camera's pose (4, 4) by odometry, m, and the time."""
        self._goals = [each for each in self._goals if each.is_recent(t_ns)]
        known = next((each for each in self._goals if each.is_near(T_world_goal)), None)
        if known is None:
            self._goals.append(_FalseGoal(T_world_goal, t_ns))
        else:
            known.T_world_goal, known.t_ns, known.times = T_world_goal, t_ns, known.times + 1

    def excluded(self, t_ns: int) -> list[FloatArray]:
        """Pose ``T_world_goal`` (4, 4), m, of each that is excluded at a time."""
        return [each.T_world_goal for each in self._goals if each.is_excluded(t_ns)]
