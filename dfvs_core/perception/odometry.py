"""Velocity at a frame, and motion since the one before, by the vehicle's state estimate."""

import numpy as np

from dfvs_core.geometry.arrays import FloatArray
from dfvs_core.geometry.poses import so3_log
from dfvs_core.perception.keyframes import Keyframe
from dfvs_core.perception.vehicle_history import Motion


def frame_odometry(
    motion: Motion, T_world_camera: FloatArray, last: Keyframe | None, *, is_level: bool
) -> tuple[FloatArray, tuple[float, float, float]]:
    """Velocity (d,) in the task's basis; motion since the last frame, m, in its optical axes.

    Parameters
    ----------
    motion : Motion
        The vehicle's state at the frame.
    T_world_camera : (4, 4)
        The camera's pose then, m.
    last : Keyframe or None
        The frame before.
    is_level : bool
        Whether the basis is level (x, y, z, yaw), else the camera's six degrees of freedom, m/s
        and rad/s.
    """
    R, moved, turning = T_world_camera[:3, :3], np.zeros(3), np.zeros(3)
    if last is not None:
        R_last = last.T_world_camera[:3, :3]
        moved = R_last.T @ (T_world_camera[:3, 3] - last.T_world_camera[:3, 3])
        if (since_ns := motion.t_ns - last.t_capture_ns) > 0:
            turning = so3_log(R_last.T @ R) / (since_ns * 1e-9)
    x, y, z = moved.tolist()
    if is_level:
        return motion.level_velocity(), (x, y, z)
    return np.append(R.T @ motion.velocity_m_s, turning), (x, y, z)
