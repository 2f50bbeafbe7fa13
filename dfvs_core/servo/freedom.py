"""Degrees of freedom of the camera motion, and their frame.

A free camera has all six. A multirotor has four: forward, right, down and yaw rate of a body
that is kept level by its autopilot, which tilts to move. So its images are first taken to a
gravity-aligned virtual camera: the camera as it would look if the body were level, at the same
place and heading. In that frame the four motions are exact, whatever the tilt.
"""

from dataclasses import dataclass

import numpy as np

from dfvs_core.geometry.arrays import BoolArray, FloatArray
from dfvs_core.geometry.camera import homogeneous
from dfvs_core.geometry.poses import rotation_from_euler, se3_exp, se3_log

MIN_RAY_FORWARD = 0.15
"""Rays that leave the virtual camera more than 81 degrees off its axis are not used."""


@dataclass(frozen=True, slots=True)
class MotionBasis:
    """Linear map B (6, d) from the motions the vehicle has to the camera's twist.

    The columns span a group of rigid motions, so ``exp(B u)`` stays inside it.
    """

    B: FloatArray

    @property
    def size(self) -> int:
        """Number of degrees of freedom."""
        return int(self.B.shape[1])

    def exp(self, u: FloatArray) -> FloatArray:
        """Camera motion (4, 4) after the motion u : (d,) (m, rad)."""
        return se3_exp(self.B @ u)

    def log(self, T: FloatArray) -> FloatArray:
        """Motion (d,) (m, rad) that gives T : (4, 4), by least squares."""
        u = np.linalg.lstsq(self.B, se3_log(T), rcond=None)[0]
        return np.asarray(u, dtype=np.float64)


def free_camera() -> MotionBasis:
    """Six degrees of freedom: the camera's own twist."""
    return MotionBasis(np.eye(6))


def level_body(T_body_camera: FloatArray) -> MotionBasis:
    """Four degrees of freedom: forward, right, down (m) and yaw (rad) of a level body.

    Parameters
    ----------
    T_body_camera : (4, 4)
        Mounting of the camera; a lens away from the yaw axis moves when the body yaws.
    """
    R_camera_body = T_body_camera[:3, :3].T
    down = np.array([0.0, 0.0, 1.0])
    B = np.zeros((6, 4))
    B[:3, :3] = R_camera_body
    B[:3, 3] = R_camera_body @ np.cross(down, T_body_camera[:3, 3])
    B[3:, 3] = R_camera_body @ down
    return MotionBasis(B)


def virtual_rotation(
    roll_rad: float, pitch_rad: float, R_body_camera: FloatArray, R_body_virtual: FloatArray
) -> FloatArray:
    """Rotation (3, 3) from a tilted camera to the gravity-aligned virtual camera.

    Parameters
    ----------
    roll_rad, pitch_rad : float
        Attitude of the body when the image was taken.
    R_body_camera : (3, 3)
        Mounting of the camera that took it.
    R_body_virtual : (3, 3)
        Mounting of the virtual camera on the level body: that of the camera that flies.
    """
    R_level_body = rotation_from_euler(roll_rad, pitch_rad, 0.0)
    R: FloatArray = R_body_virtual.T @ R_level_body @ R_body_camera
    return R


def rotate_rays(R: FloatArray, xy: FloatArray) -> tuple[FloatArray, FloatArray, BoolArray]:
    """Normalised coordinates in a camera turned by R.

    Parameters
    ----------
    R : (3, 3)
        Takes rays of the old camera to the new one.
    xy : (N, 2)
        Normalised coordinates in the old camera.

    Returns
    -------
    xy_new : (N, 2)
        Normalised coordinates in the new camera.
    depth_ratio : (N,)
        New depth over old depth of the point on that ray.
    usable : (N,) bool
        False where the ray points aside or backwards in the new camera.
    """
    rays = homogeneous(xy) @ R.T
    usable: BoolArray = rays[:, 2] > MIN_RAY_FORWARD
    forward = np.where(usable, rays[:, 2], 1.0)
    return rays[:, :2] / forward[:, None], forward, usable
