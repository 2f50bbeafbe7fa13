"""Camera poses in a scene: given by hand, or known at every time."""

from collections.abc import Callable

import numpy as np
from numpy.typing import ArrayLike

from dfvs_core.errors import GeometryError
from dfvs_core.geometry.arrays import FloatArray
from dfvs_core.geometry.poses import R_BODY_FORWARD_CAMERA, make_pose, rotation_from_euler
from dfvs_sim.scene.frames import ned_from_gltf

CameraPoses = Callable[[int], FloatArray | None]
"""``T_scene_camera`` (4, 4) at a monotonic time in ns, None where it is not known."""

_DOWN: FloatArray = np.array([0.0, 0.0, 1.0])


def camera_pose(
    position_ned: tuple[float, float, float], yaw_rad: float, pitch_rad: float = 0.0
) -> FloatArray:
    """``T_world_camera`` (4, 4) of a camera at (north, east, down) m.

    Yaw 0 looks north (-z of the scene file), pi/2 east (+x of the file); positive pitch looks up.
    """
    R = rotation_from_euler(0.0, pitch_rad, yaw_rad) @ R_BODY_FORWARD_CAMERA
    return make_pose(R, np.array(position_ned, dtype=np.float64))


def look_at(eye_gltf: ArrayLike, target_gltf: ArrayLike) -> FloatArray:
    """``T_world_camera`` (4, 4) in NED of a camera at eye that looks at target, its top upwards.

    Both points (3,) are in the scene file's axes: x right, y up, m.

    Raises
    ------
    GeometryError
        If the points coincide, or one lies straight above the other.
    """
    eye, target = ned_from_gltf(np.asarray(eye_gltf)), ned_from_gltf(np.asarray(target_gltf))
    forward = target - eye
    right = np.cross(_DOWN, forward)
    if np.linalg.norm(right) < 1e-6 * max(1.0, float(np.linalg.norm(forward))):
        raise GeometryError(
            f"the view from {eye} to {target} (NED) has no direction in the plan",
            "two points that are not straight above each other",
        )
    z = forward / np.linalg.norm(forward)
    x = right / np.linalg.norm(right)
    return make_pose(np.stack([x, np.cross(z, x), z], axis=1), eye)
