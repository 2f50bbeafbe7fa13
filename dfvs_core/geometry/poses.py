"""Rigid motions: rotations, poses and twists.

``T_a_b`` (4, 4) and ``R_a_b`` (3, 3) take b-coordinates to a: ``p_a = R_a_b @ p_b + t_a_b``.
A twist is (v, w): linear velocity in m/s, then angular velocity in rad/s, both in the moving
frame. World is NED, body is FRD, camera is optical (x right, y down, z forward).
"""

import numpy as np

from dfvs_core.errors import GeometryError
from dfvs_core.geometry.arrays import FloatArray

R_BODY_FORWARD_CAMERA: FloatArray = np.array([[0.0, 0.0, 1.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])
"""Rotation of a camera that looks straight ahead: z is body x, x is body y, y is body z."""

_SMALL_ANGLE_RAD = 1e-7


def skew(v: FloatArray) -> FloatArray:
    """Matrix of the cross product, ``skew(v) @ u == cross(v, u)``; v : (3,)."""
    x, y, z = v
    return np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])


def so3_exp(w: FloatArray) -> FloatArray:
    """Rotation (3, 3) by the rotation vector w : (3,) rad (Rodrigues' formula)."""
    angle = float(np.linalg.norm(w))
    W = skew(w)
    a = np.sin(angle) / angle if angle > _SMALL_ANGLE_RAD else 1.0
    b = (1.0 - np.cos(angle)) / angle**2 if angle > 1e-5 else 0.5
    R: FloatArray = np.eye(3) + a * W + b * W @ W
    return R


def so3_log(R: FloatArray) -> FloatArray:
    """Rotation vector (3,) rad of R : (3, 3), its length in [0, pi]."""
    w, x, y, z = quaternion_from_rotation(R)
    v = np.array([x, y, z])
    sine = float(np.linalg.norm(v))
    if sine < _SMALL_ANGLE_RAD:
        return 2.0 * v
    angle = 2.0 * np.arctan2(sine, w)
    w_vector: FloatArray = v * (angle / sine)
    return w_vector


def _left_jacobian(w: FloatArray) -> FloatArray:
    """Left Jacobian of SO(3), which couples translation to rotation in ``se3_exp``."""
    angle = float(np.linalg.norm(w))
    W = skew(w)
    a = (1.0 - np.cos(angle)) / angle**2 if angle > 1e-5 else 0.5
    b = (angle - np.sin(angle)) / angle**3 if angle > 1e-5 else 1.0 / 6.0
    J: FloatArray = np.eye(3) + a * W + b * W @ W
    return J


def se3_exp(twist: FloatArray) -> FloatArray:
    """Pose (4, 4) reached by the constant twist (6,) (m, rad) within one unit of time."""
    v, w = twist[:3], twist[3:]
    return make_pose(so3_exp(w), _left_jacobian(w) @ v)


def se3_log(T: FloatArray) -> FloatArray:
    """Constant twist (6,) (m, rad) that reaches T : (4, 4) within one unit of time."""
    w = so3_log(T[:3, :3])
    v = np.linalg.solve(_left_jacobian(w), T[:3, 3])
    return np.concatenate([v, w])


def make_pose(R: FloatArray, t: FloatArray) -> FloatArray:
    """Pose (4, 4) from rotation R : (3, 3) and translation t : (3,) m."""
    T = np.eye(4)
    T[:3, :3] = R
    T[:3, 3] = t
    return T


def invert_pose(T_a_b: FloatArray) -> FloatArray:
    """``T_b_a`` (4, 4) from ``T_a_b``."""
    R = T_a_b[:3, :3].T
    return make_pose(R, -R @ T_a_b[:3, 3])


def check_pose(T: FloatArray, name: str = "pose") -> FloatArray:
    """Return T as float64 (4, 4) after checking that it is a finite rigid motion.

    Raises
    ------
    GeometryError
        If the shape is wrong, a value is not finite, the rotation is not orthonormal, or the
        last row is not that of a pose.
    """
    T = np.asarray(T, dtype=np.float64)
    if T.shape != (4, 4) or not np.isfinite(T).all():
        raise GeometryError(f"{name} has shape {T.shape} or values that are not finite", "(4, 4)")
    R = T[:3, :3]
    if not np.allclose(R @ R.T, np.eye(3), atol=1e-5) or np.linalg.det(R) < 0:
        raise GeometryError(f"{name} has a rotation that is not orthonormal", "a rigid motion")
    if not np.allclose(T[3], [0.0, 0.0, 0.0, 1.0], atol=1e-6):
        last = ", ".join(f"{value:g}" for value in T[3])
        raise GeometryError(
            f"{name} has the last row ({last})", "0, 0, 0, 1", "it may be transposed"
        )
    return T


def rotation_from_euler(roll_rad: float, pitch_rad: float, yaw_rad: float) -> FloatArray:
    """``R_world_body`` (3, 3) from aerospace angles, applied yaw, then pitch, then roll."""
    cr, sr = np.cos(roll_rad), np.sin(roll_rad)
    cp, sp = np.cos(pitch_rad), np.sin(pitch_rad)
    cy, sy = np.cos(yaw_rad), np.sin(yaw_rad)
    return np.array(
        [
            [cy * cp, cy * sp * sr - sy * cr, cy * sp * cr + sy * sr],
            [sy * cp, sy * sp * sr + cy * cr, sy * sp * cr - cy * sr],
            [-sp, cp * sr, cp * cr],
        ]
    )


def euler_from_rotation(R_world_body: FloatArray) -> tuple[float, float, float]:
    """(roll, pitch, yaw) in rad of R : (3, 3); pitch in [-pi/2, pi/2], at whose ends roll is 0."""
    R = R_world_body
    pitch = float(np.arcsin(np.clip(-R[2, 0], -1.0, 1.0)))
    if np.hypot(R[2, 1], R[2, 2]) < _SMALL_ANGLE_RAD:  # roll and yaw turn about one axis
        return 0.0, pitch, float(np.arctan2(-R[0, 1], R[1, 1]))
    roll = float(np.arctan2(R[2, 1], R[2, 2]))
    yaw = float(np.arctan2(R[1, 0], R[0, 0]))
    return roll, pitch, yaw


def quaternion_from_rotation(R: FloatArray) -> FloatArray:
    """Unit quaternion (4,) as (w, x, y, z) with w >= 0 of R : (3, 3) (Shepperd's method)."""
    squares = np.array(
        [
            1.0 + R[0, 0] + R[1, 1] + R[2, 2],
            1.0 + R[0, 0] - R[1, 1] - R[2, 2],
            1.0 - R[0, 0] + R[1, 1] - R[2, 2],
            1.0 - R[0, 0] - R[1, 1] + R[2, 2],
        ]
    )
    off = np.array(
        [
            [0.0, R[2, 1] - R[1, 2], R[0, 2] - R[2, 0], R[1, 0] - R[0, 1]],
            [R[2, 1] - R[1, 2], 0.0, R[0, 1] + R[1, 0], R[0, 2] + R[2, 0]],
            [R[0, 2] - R[2, 0], R[0, 1] + R[1, 0], 0.0, R[1, 2] + R[2, 1]],
            [R[1, 0] - R[0, 1], R[0, 2] + R[2, 0], R[1, 2] + R[2, 1], 0.0],
        ]
    )
    best = int(np.argmax(squares))
    q: FloatArray = off[best].copy()
    q[best] = squares[best]
    q *= np.copysign(1.0, q[0]) / float(np.linalg.norm(q))
    return q


def rotation_from_quaternion(q: FloatArray) -> FloatArray:
    """Rotation (3, 3) of the quaternion q : (4,) as (w, x, y, z); q is normalised first."""
    w, x, y, z = np.asarray(q, dtype=np.float64) / np.linalg.norm(q)
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
        ]
    )


def pose_error(T_world_a: FloatArray, T_world_b: FloatArray) -> tuple[float, float]:
    """Distance in m and rotation angle in rad between two poses (4, 4)."""
    translation_m = float(np.linalg.norm(T_world_a[:3, 3] - T_world_b[:3, 3]))
    rotation = so3_log(T_world_a[:3, :3].T @ T_world_b[:3, :3])
    return translation_m, float(np.linalg.norm(rotation))


def wrap_angle(angle_rad: float) -> float:
    """Angle in rad taken to [-pi, pi)."""
    return float((angle_rad + np.pi) % (2.0 * np.pi) - np.pi)
