"""Camera odometry between frames, from the vehicle's state."""

from __future__ import annotations

import numpy as np

from dfvs_core.geometry.arrays import FloatArray
from dfvs_core.geometry.poses import so3_log
from dfvs_core.perception.keyframes import Keyframe
from dfvs_core.perception.vehicle_history import Motion
from dfvs_core.servo.task import ServoTask


def odometry(
    task: ServoTask, last: Keyframe | None, motion: Motion, T_world_camera: FloatArray
) -> tuple[FloatArray, tuple[float, float, float]]:
    """Velocity (d,) in the components of the task's basis, and motion since the last frame.

    The motion is in the optical axes of the last frame, m; zero without one.
    """
    R, moved, turning = T_world_camera[:3, :3], np.zeros(3), np.zeros(3)
    if last is not None:
        R_last = last.T_world_camera[:3, :3]
        moved = R_last.T @ (T_world_camera[:3, 3] - last.T_world_camera[:3, 3])
        if (since_ns := motion.t_ns - last.t_capture_ns) > 0:
            turning = so3_log(R_last.T @ R) / (since_ns * 1e-9)
    x, y, z = (float(value) for value in moved)
    if task.mount is not None:
        return motion.level_velocity(), (x, y, z)
    return np.append(R.T @ motion.velocity_m_s, turning), (x, y, z)
