"""Correspondences by the renderer's own depth: a matcher that is right up to noise."""

from collections.abc import Sequence

import cv2
import numpy as np

from dfvs_core.errors import ImageError
from dfvs_core.geometry.arrays import Float32Array, FloatArray, ImageArray
from dfvs_core.geometry.camera import CameraModel
from dfvs_core.matching.correspondence import FlowField
from dfvs_core.matching.matcher import ImageFeatures
from dfvs_sim.render.renderer import Renderer
from dfvs_sim.render.truth import correspondences

_CELL_PX = 16


class KnownView(ImageFeatures):
    """An image whose pose (4, 4) and depth (H, W) m are known."""

    def __init__(self, T_world_camera: FloatArray, depth_m: Float32Array) -> None:
        super().__init__(depth_m.shape)
        self.T_world_camera = T_world_camera
        self.depth_m = depth_m


class ExactMatcher:
    """Exact flow with noise that is smooth over a few cells, as that of a network is.

    :meth:`look_from` is told the camera's pose before each image is encoded. ``noise_px`` is the
    standard deviation of each component of the flow.
    """

    def __init__(
        self, renderer: Renderer, camera: CameraModel, noise_px: float, rng: np.random.Generator
    ) -> None:
        self._renderer, self._camera = renderer, camera
        self._noise_px, self._rng = noise_px, rng
        self._T_world_camera: FloatArray = np.eye(4)

    def look_from(self, T_world_camera: FloatArray) -> None:
        """Take the pose (4, 4) of the images to come."""
        self._T_world_camera = T_world_camera.copy()

    def encode(self, image: ImageArray) -> KnownView:
        """Depth of the view from the pose; the image is not looked at."""
        T = self._T_world_camera
        return KnownView(T, self._renderer.depth(self._camera, T))

    def match(
        self, current: ImageFeatures, other: ImageFeatures, *, excluded: Sequence[FlowField] = ()
    ) -> FlowField:
        """Exact flow plus noise, confidence 1 where both see the point."""
        if not isinstance(current, KnownView) or not isinstance(other, KnownView):
            raise ImageError("an image whose pose is not known", "images of this matcher")
        poses = current.T_world_camera, other.T_world_camera
        flow, seen = correspondences(self._camera, poses, (current.depth_m, other.depth_m))
        height, width = seen.shape
        cells = (height // _CELL_PX + 1, width // _CELL_PX + 1, 2)
        noise = self._rng.normal(0.0, 1.3 * self._noise_px, cells).astype(np.float32)
        flow = np.nan_to_num(flow) + cv2.resize(noise, (width, height))
        return FlowField(flow.astype(np.float32), seen.astype(np.float32))

    def track(
        self, current: ImageFeatures, other: ImageFeatures, predicted: FlowField
    ) -> FlowField:
        """Like :meth:`match`."""
        return self.match(current, other)

    def extend(
        self, current: ImageFeatures, other: ImageFeatures, known: FlowField
    ) -> FlowField | None:
        """Nothing: :meth:`match` has all."""
        return None
