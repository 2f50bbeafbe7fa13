"""Pairs of views of a plane, by homographies, perturbed as Bateux et al. (ICRA 2018) do it.

Perturbations are of light (a sum of Gaussians over the image), of occlusion (coherent clusters of
pixels of another image), and of the camera: exposure, blur, noise.
"""

import math
from typing import NamedTuple, cast

import cv2
import numpy as np

from dfvs_core.geometry.arrays import Float32Array, FloatArray, ImageArray
from dfvs_core.geometry.camera import CameraModel, homogeneous
from dfvs_core.geometry.poses import invert_pose, make_pose, so3_exp
from dfvs_export.networks.pose_regression import SIZE
from dfvs_export.training.pose_pairs import STRIDE, PosePair, flow_to, normalised
from dfvs_export.training.room_pairs import RoomReader, view_of

_MOST_TRANSLATION = (0.22, 0.22, 0.16)
_MOST_ROTATION_RAD = tuple(np.radians((18.0, 18.0, 45.0)))
"""Greatest displacement along and about the camera's axes; translation over the distance."""
_SMALL_ONES = 1.5
"""Exponent on the uniform share of the greatest displacement: small ones are more frequent."""
_GOAL_SHARE = 0.25
"""Displacement of the goal's view from looking straight at the plane, in the greatest one."""
_TEXTURE_WIDTH = (1.6, 3.2)
"""Of the photograph on the plane, over the distance; beyond it is mirrored."""
_TEXTURE_PX_PER_PX = 1.3
"""Of a view, at most; a larger photograph is reduced before it is seen, or it would flicker."""
_FOCAL = (0.5, 0.87)
"""Focal length over width: fields of view of 90 to 60 degrees."""
_LIT, _LIGHTS, _LIGHT = 0.5, 3, (-0.6, 0.8)
"""Share of views with another light, count of its Gaussians at most, and their heights."""
_OCCLUDED, _MOST_OCCLUDED = 0.4, 0.3
"""Share of views that something is in front of, and the most that it covers."""
_GAMMA, _GAIN, _OFFSET = (0.7, 1.4), (0.6, 1.3), (-0.06, 0.06)
_BLURRED, _BLUR_PX = 0.3, (0.3, 0.9)
_NOISE = 0.02
"""Exposure, share and size of blur, and noise at most, on grey levels from 0 to 1."""


class PlanarMotion(NamedTuple):
    """Two poses (4, 4) in the frame of the plane z = 1 that both look at, and a camera."""

    T_plane_first: FloatArray
    T_plane_second: FloatArray
    camera: CameraModel

    @classmethod
    def drawn(cls, rng: np.random.Generator) -> "PlanarMotion":
        """Two poses near to one that looks straight at the plane from a distance of 1."""
        T_plane_second = _displacement(_GOAL_SHARE * rng.uniform(), rng)
        T_second_first = _displacement(rng.uniform() ** _SMALL_ONES, rng)
        f = rng.uniform(*_FOCAL) * SIZE[0]
        camera = CameraModel(*SIZE, f, f, SIZE[0] / 2, SIZE[1] / 2)
        return cls(T_plane_second @ T_second_first, T_plane_second, camera)

    @property
    def focal(self) -> float:
        """Focal length over the width."""
        return self.camera.fx / self.camera.width

    def in_depths(self) -> FloatArray:
        """``T_first_second`` (4, 4), its unit the depth at the second view's middle."""
        T = invert_pose(self.T_plane_first) @ self.T_plane_second
        T[:3, 3] /= (1.0 - self.T_plane_second[2, 3]) / self.T_plane_second[2, 2]
        return T

    def seen(self, stride: int) -> FloatArray:
        """Pixels (h, w, 2) of the second view that every stride-th one of the first leads to."""
        first, second = (_view_from_plane(T) for T in self[:2])
        there = homogeneous(self.camera.normalise(self.camera.grid(stride)))
        return self.camera.project(there @ (second @ np.linalg.inv(first)).T)


class PlanarPoseReader(RoomReader):
    """Draws pairs of views of a photograph on a plane; the photographs are views of rooms."""

    def draw(self) -> PosePair:
        """Draw the next pair; its unit is the depth at the second view's middle."""
        rng = self._rng
        motion = PlanarMotion.drawn(rng)
        width, turn = rng.uniform(*_TEXTURE_WIDTH), rng.uniform(-math.pi, math.pi)
        texture = self._photograph()
        per_px = texture.shape[1] / (width * motion.camera.fx)
        scale = min(1.0, _TEXTURE_PX_PER_PX / per_px)
        texture = cast(
            ImageArray, cv2.resize(texture, None, fx=scale, fy=scale, interpolation=cv2.INTER_AREA)
        )
        laid = width / texture.shape[1], turn
        views = [_view(motion.camera, T, texture, laid) for T in motion[:2]]
        first, second = (normalised(self._perturbed(view)) for view in views)
        flow = flow_to(motion.camera, motion.seen(STRIDE))
        return PosePair(first, second, motion.focal, motion.in_depths(), flow)

    def _photograph(self) -> ImageArray:
        room, k = self._draw_pair()
        return view_of(room, k, "ab"[self._rng.integers(2)])

    def _perturbed(self, view: ImageArray) -> Float32Array:
        rng = self._rng
        grey = view.astype(np.float32) / np.float32(255.0)
        if rng.uniform() < _LIT:
            grey = grey * light(rng)
        if rng.uniform() < _OCCLUDED:
            other = cv2.resize(self._photograph(), SIZE, interpolation=cv2.INTER_AREA)
            share = rng.uniform(0.0, _MOST_OCCLUDED)
            grey = np.where(cluster(share, rng), other / np.float32(255.0), grey)
        grey = grey ** rng.uniform(*_GAMMA) * rng.uniform(*_GAIN) + rng.uniform(*_OFFSET)
        if rng.uniform() < _BLURRED:
            grey = cv2.GaussianBlur(grey, (0, 0), rng.uniform(*_BLUR_PX)).astype(np.float32)
        grey = grey + rng.normal(0, rng.uniform(0.0, _NOISE), grey.shape)
        return np.asarray(255.0 * np.clip(grey, 0.0, 1.0), np.float32)


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
    height, width = texture.shape
    span, turn = laid
    c, s = span * math.cos(turn), span * math.sin(turn)
    middle = np.array([[1, 0, -width / 2], [0, 1, -height / 2], [0, 0, 1.0]])
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
