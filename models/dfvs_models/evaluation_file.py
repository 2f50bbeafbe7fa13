"""Evaluation files: image pairs with exact flow, images with exact depth.

One ``.npz``; pixel centres lie at +0.5, images are RGB:

- ``IA``, ``IB`` (N, H, W, 3) uint8, the two images;
- ``flow`` (N, H, W, 2) float16 px, from A to B on A's grid;
- ``vis`` (N, H, W) bool, seen in both;
- ``level`` (N,) int64, index into ``dfvs_models.evaluation.LEVELS``;
- ``depth`` (N, H, W) float16 m along the optical axis of A (0: nothing), for depth alone;
- and, not needed to measure, ``TA``, ``TB`` (N, 4, 4) float64, world from camera in the scene
  file's axes (y up).
"""

import zipfile
import zlib
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dfvs_core.errors import ImageError
from dfvs_core.geometry.arrays import BoolArray, Float32Array, ImageArray
from dfvs_core.geometry.camera import CameraModel
from dfvs_models.evaluation import LEVELS

EVALUATION_CAMERA = CameraModel(320, 240, 208.5, 208.5, 160.0, 120.0)
"""The camera of an evaluation file: 75 degrees wide."""

_Arrays = dict[str, NDArray[Any]]
_ARRAYS = ("IA", "IB", "flow", "vis", "level")
"""Arrays that a measurement of flow needs."""
_DEPTH_ARRAYS = ("IA", "depth")


def labelled(paths: Iterable[Path]) -> dict[str, Path]:
    """Files by their names; those that share a name, by their paths. Each file is there once."""
    paths = list(dict.fromkeys(paths))
    names = [path.name for path in paths]
    return {path.name if names.count(path.name) == 1 else str(path): path for path in paths}


@dataclass(frozen=True, slots=True, eq=False)
class FlowPairs:
    """Image pairs with exact flow.

    Parameters
    ----------
    current, other : (N, H, W, 3) uint8
        The two images, RGB.
    flow : (N, H, W, 2) float32
        px, from ``current`` to ``other``, on the grid of ``current``.
    visible : (N, H, W) bool
        Seen in both.
    level : (N,) int64
        Index into ``dfvs_models.evaluation.LEVELS``.
    """

    current: ImageArray
    other: ImageArray
    flow: Float32Array
    visible: BoolArray
    level: NDArray[np.int64]


def read_flow_pairs(path: Path) -> FlowPairs:
    """Read an evaluation file.

    Raises
    ------
    ImageError
        If it cannot be read, lacks an array, or its arrays do not fit each other.
    """
    arrays = _read(path, _ARRAYS)
    _check_shapes(path, arrays)
    pairs = FlowPairs(
        arrays["IA"],
        arrays["IB"],
        arrays["flow"].astype(np.float32),
        arrays["vis"].astype(np.bool_),
        arrays["level"].astype(np.int64),
    )
    _check_values(path, pairs)
    return pairs


def read_depth_views(path: Path) -> tuple[ImageArray, Float32Array]:
    """Images (N, H, W, 3) uint8 RGB of an evaluation file, and their depth (N, H, W) m.

    Raises
    ------
    ImageError
        If it cannot be read, lacks an array, or an image has no depth anywhere.
    """
    arrays = _read(path, _DEPTH_ARRAYS)
    images, depth_m = arrays["IA"], arrays["depth"].astype(np.float32)
    if images.ndim != 4 or images.dtype != np.uint8 or images.shape != (*depth_m.shape, 3):
        raise ImageError(
            f"IA in {str(path)!r} is {images.dtype} of {images.shape}, depth of {depth_m.shape}",
            "uint8 of (N, H, W, 3) and (N, H, W)",
        )
    if not np.isfinite(depth_m).all() or not (depth_m > 0).any(axis=(1, 2)).all():
        raise ImageError(f"depth in {str(path)!r} is not finite, or nowhere known", "depth in m")
    return images, depth_m


def _read(path: Path, names: tuple[str, ...]) -> _Arrays:
    try:
        with zipfile.ZipFile(path), np.load(path, allow_pickle=False) as data:
            return {name: data[name] for name in names}
    except (OSError, ValueError, KeyError, EOFError, zlib.error, zipfile.BadZipFile) as error:
        raise ImageError(
            f"pairs file {str(path)!r} cannot be read ({error})", _expected(names)
        ) from error


def _expected(names: tuple[str, ...]) -> str:
    return f"an .npz with {', '.join(names)}"


def _check_shapes(path: Path, arrays: _Arrays) -> None:
    if arrays["IA"].ndim != 4:
        raise ImageError(f"IA in {str(path)!r} has the shape {arrays['IA'].shape}", "(N, H, W, 3)")
    count, height, width = arrays["IA"].shape[:3]
    expected = {
        "IA": ((count, height, width, 3), "u"),
        "IB": ((count, height, width, 3), "u"),
        "flow": ((count, height, width, 2), "f"),
        "vis": ((count, height, width), "bu"),
        "level": ((count,), "iu"),
    }
    for name, (shape, kinds) in expected.items():
        array = arrays[name]
        if array.shape != shape:
            raise ImageError(f"{name} in {str(path)!r} has the shape {array.shape}", str(shape))
        if array.dtype.kind not in kinds or (name in ("IA", "IB") and array.dtype != np.uint8):
            raise ImageError(f"{name} in {str(path)!r} is {array.dtype}", _expected(_ARRAYS))


def _check_values(path: Path, pairs: FlowPairs) -> None:
    if len(pairs.level) == 0 or not np.isin(pairs.level, range(len(LEVELS))).all():
        raise ImageError(
            f"{str(path)!r} holds {len(pairs.level)} pairs or an unknown level", "levels 0, 1, 2"
        )
    blind = np.flatnonzero(~pairs.visible.any(axis=(1, 2)))
    if len(blind):
        raise ImageError(f"pair {blind[0]} in {str(path)!r} has no pixel that is seen in both")
    if not np.isfinite(pairs.flow[pairs.visible]).all():
        raise ImageError(f"flow in {str(path)!r} is not finite where it is visible", "flow in px")
