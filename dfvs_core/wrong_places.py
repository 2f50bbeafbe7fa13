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

_SAME_M, _SAME_RAD = 0.3, 0.2
"""How near two places are that count as one."""
_TIMES = 2
"""How often a place has to be a mistake: somebody may walk through the view at the goal."""
_REMEMBERED_NS = 30_000_000_000
"""How long ago the last time may be: odometry drifts, and who hid the goal may be gone."""


@dataclass(slots=True)
class _Place:
    T_world_goal: FloatArray
    t_ns: int
    times: int = 1

    def is_near(self, T_world_goal: FloatArray) -> bool:
        distance_m, angle_rad = pose_error(self.T_world_goal, T_world_goal)
        return distance_m < _SAME_M and angle_rad < _SAME_RAD


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

    def add(self, T_world_goal: FloatArray, t_ns: int) -> None:
        """Remember a mistake: where (4, 4) the goal's camera would be, by odometry, m; and when."""
        self._forgive(t_ns)
        place = next((each for each in self._places if each.is_near(T_world_goal)), None)
        if place is None:
            self._places.append(_Place(T_world_goal, t_ns))
        else:
            place.T_world_goal, place.t_ns, place.times = T_world_goal, t_ns, place.times + 1

    def _forgive(self, t_ns: int) -> None:
        """Let go of places that were no mistake for a while."""
        self._places = [each for each in self._places if t_ns - each.t_ns <= _REMEMBERED_NS]

    def flows(self, T_world_camera: FloatArray, t_ns: int, depth: DepthMap) -> list[FlowField]:
        """Flow to each of them from a camera (4, 4) m that sees this depth, on the grid."""
        self._forgive(t_ns)
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
