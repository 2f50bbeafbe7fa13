"""Servo task: settings, cameras and goal, constant during a flight."""

from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from dfvs_core.depth.network import GoalDepth
from dfvs_core.geometry.arrays import FloatArray
from dfvs_core.geometry.camera import CameraModel
from dfvs_core.messages.goal import GoalSidecar, Mount
from dfvs_core.servo.config import ServoConfig
from dfvs_core.servo.freedom import MotionBasis, free_camera, level_body
from dfvs_core.servo.velocity import SpeedLimit


@dataclass(frozen=True, slots=True)
class ServoTask:
    """What stays the same during a flight to one goal.

    ``mount`` None is a free camera with six degrees of freedom; otherwise a level body with
    four, carrying the camera so. ``unit_m`` is the length of a unit of depth, m: translations of
    ``basis`` are in that unit. ``goal_depth`` is a network's depth of the goal view, if any.
    """

    config: ServoConfig
    camera: CameraModel
    goal: GoalSidecar
    mount: Mount | None = None
    unit_m: float = 1.0
    goal_depth: GoalDepth | None = None

    @property
    def T_body_camera(self) -> FloatArray:
        """Pose (4, 4) of the camera in the body that moves, m; a free camera is that body."""
        return np.eye(4) if self.mount is None else self.mount.T_body_camera()

    @property
    def basis(self) -> MotionBasis:
        """Degrees of freedom."""
        if self.mount is None:
            return free_camera()
        return _level_basis(self.mount, self.unit_m)

    @property
    def limits(self) -> tuple[SpeedLimit, ...]:
        """Speed limits on the components of the velocity."""
        c = self.config
        if self.mount is None:
            return (
                SpeedLimit((0, 1, 2), c.max_horizontal_m_s),
                SpeedLimit((3, 4, 5), c.max_turn_rad_s),
            )
        return (
            SpeedLimit((0, 1), c.max_horizontal_m_s),
            SpeedLimit((2,), c.max_vertical_m_s),
            SpeedLimit((3,), c.max_turn_rad_s),
        )

    @property
    def response_s(self) -> FloatArray:
        """How late each component of the velocity is followed, s : (d,)."""
        c = self.config
        if self.mount is None:
            return np.full(6, c.response_s)
        return np.array([c.response_s, c.response_s, c.response_s, c.yaw_response_s])


@lru_cache(maxsize=8)
def _level_basis(mount: Mount, unit_m: float) -> MotionBasis:
    """Basis of a level body whose lengths are in units; read-only, since it is kept."""
    T_body_camera = mount.T_body_camera()
    T_body_camera[:3, 3] /= unit_m
    basis = level_body(T_body_camera)
    basis.B.flags.writeable = False
    return basis
