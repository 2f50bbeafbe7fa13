"""Places that were taken for the goal and do not look like it.

Of windows that are alike any may be matched with the goal's, and a search from the same place would
find the same one again. So it is told what flow the wrong places would have, and passes over it.
"""

from __future__ import annotations

from dataclasses import dataclass, field

from dfvs_core.arrays import FloatArray
from dfvs_core.camera import CameraModel
from dfvs_core.correspondence import DepthMap, FlowField
from dfvs_core.depth.prediction import predict_flow
from dfvs_core.poses import invert_pose, pose_error

_SAME_M = 0.3
"""How near two places are that count as one."""
_TIMES = 2
"""How often a place has to be a mistake: somebody may walk through the view at the goal."""


@dataclass(slots=True)
class _Place:
    T_world_goal: FloatArray
    times: int = 1


@dataclass(slots=True)
class WrongPlaces:
    """What to pass over.

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
    _places: list[_Place] = field(default_factory=list)

    def add(self, T_world_goal: FloatArray) -> None:
        """Remember a mistake: where (4, 4) the goal's camera would be, by odometry, m."""
        for place in self._places:
            if pose_error(place.T_world_goal, T_world_goal)[0] < _SAME_M:
                place.times += 1
                place.T_world_goal = T_world_goal
                return
        self._places.append(_Place(T_world_goal))

    def flows(self, T_world_camera: FloatArray, depth: DepthMap) -> list[FlowField]:
        """Flow to each of them from a camera (4, 4) m that sees this depth, on the grid."""
        wrong = (place.T_world_goal for place in self._places if place.times >= _TIMES)
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
