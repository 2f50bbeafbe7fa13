"""Pairs of views of a plane, by homographies, perturbed as Bateux et al. (ICRA 2018) do it.

Perturbations are of light (a sum of Gaussians over the image), of occlusion (coherent clusters of
pixels of another image), and of the camera: exposure, blur, noise.
"""

import math
from typing import cast

import cv2
import numpy as np

from dfvs_core.geometry.arrays import Float32Array, FloatArray, ImageArray
from dfvs_core.geometry.camera import CameraModel
from dfvs_core.geometry.poses import invert_pose, make_pose, so3_exp
from dfvs_export.networks.pose_regression import SIZE, STRIDE
from dfvs_export.training.pose_pairs import PosePair, flow_to, normalised, rays
from dfvs_export.training.room_pairs import RoomReader, augmented, view_of

_MOST_TRANSLATION = (0.22, 0.22, 0.16)
_MOST_ROTATION_RAD = tuple(np.radians((18.0, 18.0, 45.0)))
"""Greatest displacement along and about the camera's axes; translation over the distance."""
_GOAL_SHARE = 0.25
"""Displacement of the goal's view from looking straight at the plane, in the greatest one."""
_TEXTURE_WIDTH = (1.6, 3.2)
"""Of the photograph on the plane, over the distance; beyond it is mirrored."""
_TEXTURE_PX = (320, 240)
_FOCAL = (0.5, 0.87)
"""Focal length over width: fields of view of 90 to 60 degrees."""
_LIT, _LIGHTS, _LIGHT = 0.5, 3, (-0.6, 0.8)
"""Share of views with another light, count of its Gaussians at most, and their heights."""
_OCCLUDED, _MOST_OCCLUDED = 0.4, 0.3
"""Share of views that something is in front of, and the most that it covers."""


class PlanarPoseReader(RoomReader):
    """Draws pairs of views of a photograph on a plane; the photographs are views of rooms."""

    def draw(self) -> PosePair:
        """Draw the next pair; its unit is the depth at the second view's middle."""
        rng = self._rng
        texture = self._photograph()
        T_plane_second = _displacement(_GOAL_SHARE * rng.uniform(), rng)
        T_second_first = _displacement(rng.uniform() ** 1.5, rng)
        T_plane_first = T_plane_second @ T_second_first
        span = rng.uniform(*_TEXTURE_WIDTH) / _TEXTURE_PX[0]
        turn = rng.uniform(-math.pi, math.pi)
        focal = rng.uniform(*_FOCAL)
        camera = CameraModel(*SIZE, *(focal * SIZE[0],) * 2, SIZE[0] / 2, SIZE[1] / 2)
        poses = T_plane_first, T_plane_second
        views = [_view(camera, T, texture, (span, turn)) for T in poses]
        first, second = (normalised(self._perturbed(view)) for view in views)
        T = invert_pose(T_second_first)
        flow = _flow(camera, *poses)
        T[:3, 3] /= (1.0 - T_plane_second[2, 3]) / T_plane_second[2, 2]
        return PosePair(first, second, focal, T, flow)

    def _photograph(self) -> ImageArray:
        room, k = self._draw_pair()
        image = view_of(room, k, "ab"[self._rng.integers(2)])
        return cast(ImageArray, cv2.resize(image, _TEXTURE_PX, interpolation=cv2.INTER_AREA))

    def _perturbed(self, view: ImageArray) -> Float32Array:
        rng = self._rng
        grey = view.astype(np.float32)
        if rng.uniform() < _LIT:
            grey = grey * light(rng)
        if rng.uniform() < _OCCLUDED:
            other = cv2.resize(self._photograph(), SIZE, interpolation=cv2.INTER_AREA)
            share = rng.uniform(0.0, _MOST_OCCLUDED)
            grey = np.where(cluster(share, rng), other, grey).astype(np.float32)
        return augmented(grey, rng)


def light(rng: np.random.Generator) -> Float32Array:
    """Factor (144, 192) on grey levels: 1 and a few Gaussians of any place, size and sign."""
    factor = np.ones(SIZE[::-1], np.float32)
    for _ in range(rng.integers(1, _LIGHTS + 1)):
        sigma = SIZE[0] * rng.uniform(0.1, 0.5, 2)
        x, y = (
            (np.arange(n, dtype=np.float32) - rng.uniform(0, n)) / s
            for n, s in zip(SIZE, sigma, strict=True)
        )
        bump = np.exp(-0.5 * np.add.outer(y * y, x * x))
        factor += np.float32(rng.uniform(*_LIGHT)) * bump.astype(np.float32)
    return np.maximum(factor, np.float32(0.1))


def cluster(share: float, rng: np.random.Generator) -> FloatArray:
    """Mask (144, 192) of connected blobs that cover a share of a view."""
    coarse = rng.normal(size=(6, 8)).astype(np.float32)
    smooth = cv2.resize(coarse, SIZE, interpolation=cv2.INTER_CUBIC)
    return np.asarray(smooth > np.quantile(smooth, 1.0 - share))


def _displacement(share: float, rng: np.random.Generator) -> FloatArray:
    """Motion (4, 4): any up to this share of the greatest one; lengths over the distance."""
    translation = share * rng.uniform(-1.0, 1.0, 3) * _MOST_TRANSLATION
    return make_pose(so3_exp(share * rng.uniform(-1.0, 1.0, 3) * _MOST_ROTATION_RAD), translation)


def _view(
    camera: CameraModel, T_plane_view: FloatArray, texture: ImageArray, laid: tuple[float, float]
) -> ImageArray:
    """View (144, 192) of a texture on the plane z = 1, from a pose in the plane's frame.

    The texture is ``laid`` by its length per px and its angle.
    """
    span, turn = laid
    c, s = span * math.cos(turn), span * math.sin(turn)
    middle = np.array([[1, 0, -_TEXTURE_PX[0] / 2], [0, 1, -_TEXTURE_PX[1] / 2], [0, 0, 1.0]])
    plane_from_texture = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]]) @ middle
    H = camera.matrix @ _view_from_plane(T_plane_view) @ plane_from_texture
    half = np.array([[1.0, 0.0, 0.5], [0.0, 1.0, 0.5], [0.0, 0.0, 1.0]])  # OpenCV's first pixel
    view = cv2.warpPerspective(
        texture,
        np.linalg.inv(half) @ H @ half,
        SIZE,
        flags=cv2.INTER_LINEAR,
        borderMode=cv2.BORDER_REFLECT,
    )
    return cast(ImageArray, view)


def _view_from_plane(T_plane_view: FloatArray) -> FloatArray:
    """Matrix (3, 3) from (x, y, 1) of the plane z = 1 to a view's coordinates."""
    R, t = T_plane_view[:3, :3], T_plane_view[:3, 3]
    shifted = np.eye(3)
    shifted[:, 2] -= t
    return np.asarray(R.T @ shifted, np.float64)


def _flow(
    camera: CameraModel, T_plane_first: FloatArray, T_plane_second: FloatArray
) -> Float32Array:
    """Flow (9, 12, 2) from the first view to the second, in widths."""
    grid = slice(STRIDE // 2, None, STRIDE)
    H = _view_from_plane(T_plane_second) @ np.linalg.inv(_view_from_plane(T_plane_first))
    return flow_to(camera, camera.project(rays(camera)[grid, grid] @ H.T))
