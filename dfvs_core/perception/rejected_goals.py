"""False goals that were rejected, and the flows to exclude for them.

Of repeated structures any may be matched with the goal's. A relocalisation from the same place
would find the same one again; it excludes the flows of those that were rejected.
"""

from __future__ import annotations

from dataclasses import dataclass, field

from dfvs_core.arrays import FloatArray
from dfvs_core.camera import CameraModel
from dfvs_core.correspondence import DepthMap, FlowField
from dfvs_core.depth.prediction import predict_flow
from dfvs_core.poses import invert_pose, pose_error

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


@dataclass(slots=True)
class RejectedGoals:
    """Rejected false goals of one goal.

    Parameters
    ----------
    camera, goal_camera : CameraModel
        Of the frames and of the goal's picture.
    stride_px : int
        Grid of the depth maps.
    """

    camera: CameraModel
    goal_camera: CameraModel
    stride_px: int
    _goals: list[_FalseGoal] = field(default_factory=list)

    def add(self, T_world_goal: FloatArray, t_ns: int) -> None:
        """Add a rejection: the goal camera's pose (4, 4) by odometry, m, and the time."""
        self._expire(t_ns)
        place = next((each for each in self._goals if each.is_near(T_world_goal)), None)
        if place is None:
            self._goals.append(_FalseGoal(T_world_goal, t_ns))
        else:
            place.T_world_goal, place.t_ns, place.times = T_world_goal, t_ns, place.times + 1

    def _expire(self, t_ns: int) -> None:
        """Drop the rejections of long ago."""
        self._goals = [each for each in self._goals if t_ns - each.t_ns <= _REMEMBERED_NS]

    def flows(self, T_world_camera: FloatArray, t_ns: int, depth: DepthMap) -> list[FlowField]:
        """Flow to each of them from a camera (4, 4) m that sees this depth, on the grid."""
        self._expire(t_ns)
        wrong = (place.T_world_goal for place in self._goals if place.times >= _TIMES)
        return [
            predict_flow(
                self.camera,
                depth,
                self.stride_px,
                invert_pose(T) @ T_world_camera,
                self.goal_camera,
            )
            for T in wrong
        ]
