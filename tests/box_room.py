"""An empty box seen from inside: depth and flow are exact from any pose, and nothing hides."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from dfvs_core.geometry.camera import CameraModel
from dfvs_core.geometry.poses import invert_pose
from dfvs_core.matching.correspondence import DepthMap, FlowField

HALF_SIZE_M = np.array([4.0, 3.0, 1.5])
"""The box reaches so far to the north, east and down of its centre, and as far back."""


@dataclass(frozen=True)
class BoxRoom:
    camera: CameraModel

    @cached_property
    def rays(self):
        """(H, W, 3) of the pixels, z = 1."""
        xy = self.camera.normalise(self.camera.grid())
        return np.concatenate([xy, np.ones((*xy.shape[:2], 1))], axis=2)

    def depth(self, T_world_camera):
        """(H, W) m along the optical axis."""
        directions = self.rays @ T_world_camera[:3, :3].T
        walls = np.where(directions > 0, HALF_SIZE_M, -HALF_SIZE_M)
        with np.errstate(divide="ignore"):
            reach = (walls - T_world_camera[:3, 3]) / directions
        return np.minimum(np.minimum(reach[..., 0], reach[..., 1]), reach[..., 2])

    def depth_map(self, T_world_camera):
        z = self.depth(T_world_camera).astype(np.float32)
        return DepthMap(z, np.ones_like(z))

    def flow(self, T_world_a, T_world_b):
        """Exact flow a to b; confidence 1 where b sees the point."""
        pixels = self.camera.grid()
        P = self.rays * self.depth(T_world_a)[..., None]
        T = invert_pose(T_world_b) @ T_world_a
        Q = P @ T[:3, :3].T + T[:3, 3]
        ahead = Q[..., 2] > 0.05
        Q[..., 2] = np.where(ahead, Q[..., 2], 1.0)
        partners = self.camera.project(Q)
        inside = (partners >= 0) & (partners < [self.camera.width, self.camera.height])
        visible = ahead & inside.all(axis=2)
        flow = np.where(visible[..., None], partners - pixels, 0.0)
        return FlowField(flow.astype(np.float32), visible.astype(np.float32))
