"""Where a camera can be in a scene: how far it is to the nearest surface around a point."""

import numpy as np

from dfvs_core.geometry.arrays import FloatArray
from dfvs_core.geometry.camera import CameraModel
from dfvs_core.geometry.poses import make_pose
from dfvs_sim.render.renderer import Renderer

CUBE_FACES: tuple[FloatArray, ...] = tuple(
    np.stack([x := np.roll(z, 1), np.cross(z, x), z], axis=1)
    for axis in np.eye(3)
    for z in (axis, -axis)
)
"""Rotations world from camera (3, 3) of views along +x, -x, +y, -y, +z and -z."""
_DOWN = CUBE_FACES[4]
_PROBE = CameraModel.from_horizontal_fov(32, 32, 0.5 * np.pi)
_MIDDLE = slice(12, 20)


class FreeSpace:
    """Depth in all directions around points of a scene, from six small views."""

    def __init__(self, renderer: Renderer) -> None:
        self._renderer = renderer
        x, y = _PROBE.normalise(_PROBE.grid()).transpose(2, 0, 1)
        self._ray_length = np.sqrt(1.0 + x * x + y * y)

    def clearance_m(self, point: FloatArray) -> float:
        """Distance from a point (3,) in NED to the nearest surface; the sky is far away."""
        nearest = np.inf
        for R in CUBE_FACES:
            depth = self._renderer.depth(_PROBE, make_pose(R, point))
            distance = np.where(depth > 0, depth * self._ray_length, np.inf)
            nearest = min(nearest, float(distance.min()))
        return nearest

    def below_m(self, point: FloatArray) -> float:
        """Height of a point (3,) in NED above what lies below it; 0 where nothing does."""
        depth = self._renderer.depth(_PROBE, make_pose(_DOWN, point))
        return float(np.median(depth[_MIDDLE, _MIDDLE]))
