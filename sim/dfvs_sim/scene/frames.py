"""Axes of a scene file and of our world.

A glTF file has x right, y up and z towards the viewer. Our world is NED, with its origin at the
file's origin: north = -z, east = x, down = -y of the file.
"""

import numpy as np

from dfvs_core.geometry.arrays import FloatArray
from dfvs_core.geometry.poses import make_pose

R_NED_GLTF: FloatArray = np.array([[0.0, 0.0, -1.0], [1.0, 0.0, 0.0], [0.0, -1.0, 0.0]])
"""Rotation (3, 3) that takes glTF coordinates to NED."""


def ned_from_gltf(points: FloatArray) -> FloatArray:
    """NED coordinates (..., 3) m of points (..., 3) m given in the scene file's axes."""
    ned: FloatArray = np.asarray(points, dtype=np.float64) @ R_NED_GLTF.T
    return ned


def gltf_from_ned(points: FloatArray) -> FloatArray:
    """Coordinates (..., 3) m in the scene file's axes of points (..., 3) m in NED."""
    gltf: FloatArray = np.asarray(points, dtype=np.float64) @ R_NED_GLTF
    return gltf


def ned_pose_from_gltf(T_gltf_camera: FloatArray) -> FloatArray:
    """``T_world_camera`` (4, 4) in NED of a camera pose given in the scene file's axes."""
    return make_pose(R_NED_GLTF, np.zeros(3)) @ T_gltf_camera


def gltf_pose_from_ned(T_world_camera: FloatArray) -> FloatArray:
    """Camera pose (4, 4) in the scene file's axes of ``T_world_camera`` in NED."""
    return make_pose(R_NED_GLTF.T, np.zeros(3)) @ T_world_camera


def ned_from_room(points: FloatArray) -> FloatArray:
    """NED coordinates (..., 3) of points or directions (..., 3) in room axes (solids.py)."""
    return np.asarray(points, dtype=np.float64)[..., [1, 0, 2]] * [1.0, 1.0, -1.0]
