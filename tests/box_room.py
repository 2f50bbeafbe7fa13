"""An empty box seen from inside: depth and flow are exact from any pose, and nothing hides."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from dfvs_core.depth.depth_map import DepthMap
from dfvs_core.geometry.camera import CameraModel
from dfvs_core.geometry.poses import invert_pose
from dfvs_core.matching.correspondence import FlowField, empty_flow
from dfvs_core.matching.matcher import ImageFeatures

HALF_SIZE_M = np.array([4.0, 3.0, 1.5])
"""The box reaches so far to the north, east and down of its centre, and as far back."""


@dataclass(frozen=True)
class BoxRoom:
    camera: CameraModel
    times: float = 1.0
    """As large as usual."""

    @cached_property
    def pixels(self):
        """(H, W, 2) their centres."""
        return self.camera.grid()

    @cached_property
    def rays(self):
        """(3, H * W) of the pixels, z = 1."""
        xy = self.camera.normalise(self.pixels).reshape(-1, 2).T
        return np.concatenate([xy, np.ones((1, xy.shape[1]))])

    def depth(self, T_world_camera):
        """(H, W) m along the optical axis."""
        directions = T_world_camera[:3, :3] @ self.rays
        walls = np.copysign(self.times * HALF_SIZE_M[:, None], directions)
        with np.errstate(divide="ignore"):
            reach = (walls - T_world_camera[:3, 3:]) / directions
        return reach.min(axis=0).reshape(self.pixels.shape[:2])

    def depth_map(self, T_world_camera):
        z = self.depth(T_world_camera).astype(np.float32)
        return DepthMap(z, np.ones_like(z))

    def flow(self, T_world_a, T_world_b):
        """Exact flow a to b; confidence 1 where b sees the point."""
        P = self.rays * self.depth(T_world_a).ravel()
        T = invert_pose(T_world_b) @ T_world_a
        x, y, z = T[:3, :3] @ P + T[:3, 3:]
        ahead = z > 0.05
        z = np.where(ahead, z, 1.0)
        partners = self.camera.denormalise(np.stack([x / z, y / z], axis=-1))
        u, v = partners.T
        inside = (u >= 0) & (u < self.camera.width) & (v >= 0) & (v < self.camera.height)
        visible = (ahead & inside).reshape(self.pixels.shape[:2])
        flow = np.where(visible[..., None], partners.reshape(self.pixels.shape) - self.pixels, 0.0)
        return FlowField(flow.astype(np.float32), visible.astype(np.float32))


class PosedView(ImageFeatures):
    """An image that is known by its camera's pose (4, 4) alone."""

    def __init__(self, camera, T_world_camera):
        super().__init__((camera.height, camera.width))
        self.T_world_camera = T_world_camera


class PosedMatcher:
    """Exact flow between the poses at which images were taken, with an error from ``noise()``.

    None while ``is_blind``; ``predicted`` are the flows that tracks were begun with.
    """

    def __init__(self, room, noise):
        self._room, self._noise = room, noise
        self.T_world_camera = np.eye(4)
        self.is_blind, self.predicted = False, []

    def encode(self, image):
        return PosedView(self._room.camera, self.T_world_camera.copy())

    def match(self, current, other, *, excluded=()):
        return empty_flow(current.size) if self.is_blind else self._found(current, other)

    def track(self, current, other, predicted):
        self.predicted.append(predicted)
        return None if self.is_blind else self._found(current, other)

    def extend(self, current, other, known):
        return None

    def _found(self, current, other):
        exact = self._room.flow(current.T_world_camera, other.T_world_camera)
        return FlowField((exact.flow + self._noise()).astype(np.float32), exact.confidence)
