"""Wide-baseline training pairs: read, augmented, and their true matches."""

import math
import zipfile
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, cast

import cv2
import numpy as np
from numpy.typing import NDArray

from dfvs_core.errors import ConfigError
from dfvs_core.geometry.arrays import BoolArray, Float32Array, FloatArray, ImageArray
from dfvs_core.geometry.poses import invert_pose
from dfvs_core.matching.config import MatchingConfig

SIZE = (640, 480)
"""Of the views, px (width, height)."""

_ROOMS_KEPT = 200
_OUTSIDE = -1.0
_BORDER_PX = 9
_TURNED_LIKE_THE_SERVICE = 0.85
"""Share of pairs whose second view is turned by the angle that fits best; others by any."""
_TRUE_PX, _UNMATCHABLE_PX = 3.0, 6.0
"""Distance within which a pair of points is true, and beyond which a point has no partner."""
_DEPTH_TOLERANCE, _DEPTH_TOLERANCE_M = 0.04, 0.02


@dataclass(frozen=True, slots=True)
class View:
    """An augmented view.

    ``image`` (H, W) is grey, 0 to 255, negative outside; ``warp`` (2, 3) maps px of the rendered
    view to px of ``image``; ``depth_m`` (H / 2, W / 2) is the rendered view's.
    """

    image: Float32Array
    warp: FloatArray
    depth_m: Float32Array


@dataclass(frozen=True, slots=True)
class TrainingPair:
    """Two views; ``T`` (4, 4) is the second camera in the first, ``K`` (4,) fx, fy, cx, cy."""

    first: View
    second: View
    T: FloatArray
    K: FloatArray


@dataclass(frozen=True, slots=True)
class TrueMatches:
    """Indices (M,) of true matches, and masks (N,) of points that have none."""

    first: NDArray[np.intp]
    second: NDArray[np.intp]
    first_unmatchable: BoolArray
    second_unmatchable: BoolArray


class RoomReader:
    """Draws from the rooms that ``dfvs-rooms pairs --format wide`` wrote to a folder, a file each.

    Raises
    ------
    ConfigError
        If there are none.
    """

    def __init__(self, folder: Path, seed: int) -> None:
        self._files = sorted(folder.glob("*.npz"))
        if not self._files:
            raise ConfigError(f"no pairs in {folder}", "files of dfvs-rooms pairs --format wide")
        self._rng = np.random.default_rng(seed)
        self._kept: dict[Path, dict[str, Any]] = {}

    def _draw_pair(self) -> tuple[dict[str, Any], int]:
        """Arrays of a room, and the index of one of its pairs.

        Raises
        ------
        ConfigError
            If its file cannot be read, or holds no pair.
        """
        path = self._files[self._rng.integers(len(self._files))]
        if path not in self._kept:
            if len(self._kept) >= _ROOMS_KEPT:
                self._kept.pop(next(iter(self._kept)))
            try:
                with np.load(path, allow_pickle=False) as arrays:
                    room = dict(arrays)
            except (OSError, ValueError, zipfile.BadZipFile) as error:
                raise ConfigError(f"{path} holds no pairs ({error})", "a whole file") from error
            if not len(room.get("T", ())):
                raise ConfigError(f"{path} holds no pairs", "one or more, or no such file")
            self._kept[path] = room
        room = self._kept[path]
        return room, int(self._rng.integers(len(room["T"])))


def view_of(room: Mapping[str, NDArray[Any]], pair: int, side: str) -> ImageArray:
    """Grey view (H, W) uint8 of a pair of a room; ``side`` is "a" or "b"."""
    return cast(ImageArray, cv2.imdecode(room[f"{side}{pair}"], 0))


class PairReader(RoomReader):
    """Draws augmented pairs."""

    def draw(self) -> TrainingPair:
        """Draw the next pair."""
        rng = self._rng
        room, k = self._draw_pair()
        images = [view_of(room, k, side) for side in "ab"]
        depths, T = list(room["D"][k]), room["T"][k]
        if rng.uniform() < 0.5:
            images.reverse()
            depths.reverse()
            T = np.linalg.inv(T)
        roll_rad = math.atan2(T[1, 0] - T[0, 1], T[0, 0] + T[1, 1])
        turns = np.array(MatchingConfig().turns_rad)
        nearest = turns[np.argmin(np.abs(turns + roll_rad))]
        turn = nearest if rng.uniform() < _TURNED_LIKE_THE_SERVICE else rng.choice(turns)
        tilt = math.radians(rng.uniform(-12.0, 12.0)) if rng.uniform() < 0.3 else 0.0
        zoom = rng.uniform(0.7, 1.2) if rng.uniform() < 0.25 else 1.0
        scale = rng.choice(MatchingConfig().scales)
        first = self._view(images[0], depths[0], tilt, zoom)
        return TrainingPair(first, self._view(images[1], depths[1], turn, scale), T, room["K"][k])

    def _view(self, image: ImageArray, depth_m: Float32Array, turn_rad: float, zoom: float) -> View:
        warp = cv2.getRotationMatrix2D(
            ((SIZE[0] - 1) / 2, (SIZE[1] - 1) / 2), math.degrees(turn_rad), zoom
        )
        inside = cv2.warpAffine(np.ones(SIZE[::-1], np.float32), warp, SIZE)
        window = np.ones((_BORDER_PX, _BORDER_PX), np.uint8)
        inside = cv2.erode(inside, window, borderValue=0) if turn_rad or zoom < 1.0 else inside
        warped = cv2.warpAffine(augmented(image, self._rng), warp, SIZE)
        grey = np.where(inside < 0.5, _OUTSIDE, warped).astype(np.float32)
        return View(grey, np.asarray(warp, np.float64), depth_m.astype(np.float32))


def augmented(image: ImageArray | Float32Array, rng: np.random.Generator) -> Float32Array:
    """Grey view (H, W), 0 to 255, with another exposure, light, blur, resolution and noise."""
    height, width = image.shape
    grey: Any = (image.astype(np.float32) / 255.0) ** rng.uniform(0.6, 1.6)
    grey = grey * rng.uniform(0.5, 1.3) + rng.uniform(-0.08, 0.08)
    if rng.uniform() < 0.3:
        x, y = np.linspace(-1, 1, width)[None], np.linspace(-1, 1, height)[:, None]
        grey = grey * (1.0 + x * rng.normal(0, 0.2) + y * rng.normal(0, 0.2))
    if rng.uniform() < 0.4:
        grey = cv2.GaussianBlur(grey, (0, 0), rng.uniform(0.4, 2.0))
    if rng.uniform() < 0.3:
        grey = cv2.filter2D(grey, -1, _motion_blur(rng))
    if rng.uniform() < 0.4:
        scale = rng.uniform(0.4, 0.9)
        small = cv2.resize(grey, None, fx=scale, fy=scale, interpolation=cv2.INTER_AREA)
        grey = cv2.resize(small, (width, height), interpolation=cv2.INTER_LINEAR)
    grey = grey + rng.normal(0, rng.uniform(0.0, 0.03), grey.shape)
    return np.asarray(255.0 * np.clip(grey, 0.0, 1.0), np.float32)


def _motion_blur(rng: np.random.Generator) -> Float32Array:
    kernel = np.zeros((11, 11), np.float32)
    length = int(rng.integers(3, 11))
    kernel[5, 5 - length // 2 : 5 - length // 2 + length] = 1.0
    turn = cv2.getRotationMatrix2D((5, 5), rng.uniform(0, 180), 1.0)
    kernel = np.asarray(cv2.warpAffine(kernel, turn, (11, 11)), np.float32)
    return kernel / max(float(kernel.sum()), 1e-3)


def true_matches(pair: TrainingPair, first: FloatArray, second: FloatArray) -> TrueMatches:
    """Matches of points (N, 2) and (M, 2) px of the views, by depth and pose."""
    to_second, sees_first = _transfer(first, pair.first, pair.second, invert_pose(pair.T), pair.K)
    to_first, sees_second = _transfer(second, pair.second, pair.first, pair.T, pair.K)
    there = np.linalg.norm(to_second[:, None] - second[None], axis=2)
    there[~sees_first] = np.inf
    back = np.linalg.norm(first[:, None] - to_first[None], axis=2)
    back[:, ~sees_second] = np.inf
    both, either = np.maximum(there, back), np.minimum(there, back)
    partner, owner = both.argmin(axis=1), both.argmin(axis=0)
    rows = np.arange(len(first))
    is_true = (owner[partner] == rows) & (both[rows, partner] < _TRUE_PX)
    known = [_depth_at(*side) > 0 for side in ((first, pair.first), (second, pair.second))]
    return TrueMatches(
        np.flatnonzero(is_true),
        partner[is_true],
        (either.min(axis=1) > _UNMATCHABLE_PX) & known[0],
        (either.min(axis=0) > _UNMATCHABLE_PX) & known[1],
    )


def _transfer(
    points: FloatArray, view: View, other: View, T_other_view: FloatArray, K: FloatArray
) -> tuple[FloatArray, BoolArray]:
    """Where points (N, 2) px of a view are in another, and whether they are seen there."""
    fx, fy, cx, cy = K
    u, v = _unwarped(points, view).T
    z = _depth_at(points, view)
    P = np.column_stack([(u + 0.5 - cx) / fx * z, (v + 0.5 - cy) / fy * z, z])
    Q = P @ T_other_view[:3, :3].T + T_other_view[:3, 3]
    depth = np.maximum(Q[:, 2], 1e-3)
    at = np.column_stack([Q[:, 0] / depth * fx + cx - 0.5, Q[:, 1] / depth * fy + cy - 0.5])
    there = at @ other.warp[:, :2].T + other.warp[:, 2]
    surface = _depth_at(there, other)
    near = np.abs(surface - Q[:, 2]) < _DEPTH_TOLERANCE * Q[:, 2] + _DEPTH_TOLERANCE_M
    return there, (z > 0) & (Q[:, 2] > 0) & (surface > 0) & near


def _unwarped(points: FloatArray, view: View) -> FloatArray:
    inverse = cv2.invertAffineTransform(view.warp)
    return np.asarray(points @ inverse[:, :2].T + inverse[:, 2], np.float64)


def _depth_at(points: FloatArray, view: View) -> FloatArray:
    """Depth (N,) m at points (N, 2) px of a view; 0 where there is none."""
    at = np.floor(_unwarped(points, view) / 2).astype(np.intp)
    height, width = view.depth_m.shape
    inside = ((at >= 0) & (at < (width, height))).all(axis=1)
    u, v = np.clip(at, 0, (width - 1, height - 1)).T
    return np.where(inside, view.depth_m[v, u], 0.0).astype(np.float64)
