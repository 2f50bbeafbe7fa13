"""Frames to calibrate 8 bits on, and what they put into each graph of a bundle."""

import zipfile
from collections.abc import Sequence
from pathlib import Path
from typing import cast

import cv2
import numpy as np
from numpy.typing import NDArray

from dfvs_core.errors import ConfigError
from dfvs_core.geometry.arrays import ImageArray
from dfvs_core.matching.warping import resized
from dfvs_export.bundles.runner import BundleRunner, ImagePair
from dfvs_export.precision.int8 import Feeds

_SUFFIXES = frozenset({".png", ".jpg", ".jpeg", ".bmp", ".webp"})
_FOCALS = (0.45, 1.0)
"""Focal lengths over width for which depth networks are calibrated, 96 and 53 degrees."""
_EXPECTED = "an .npz file with IA and IB, or a folder of images"


def read_frames(path: Path, size: tuple[int, int], count: int) -> list[ImagePair]:
    """Read up to ``count`` pairs, evenly over the file or folder, at ``size`` (width, height).

    Images of a folder are paired by name: the first half with the second, in order, so that a
    recorded flight gives large motion too.

    Raises
    ------
    ConfigError
        If there are no images to read.
    """
    if path.is_dir():
        files = sorted(f for f in path.iterdir() if f.suffix.lower() in _SUFFIXES)
        half = len(files) // 2
        chosen = _evenly(half, count)
        pairs = [(_read_image(files[k]), _read_image(files[half + k])) for k in chosen]
    else:
        first, second = _read_arrays(path)
        pairs = [(first[k], second[k]) for k in _evenly(len(first), count)]
    if not pairs:
        raise ConfigError(f"no pairs of images in {path}", _EXPECTED)
    return [(resized(a, size[::-1]), resized(b, size[::-1])) for a, b in pairs]


def graph_feeds(runner: BundleRunner, pairs: Sequence[ImagePair]) -> dict[str, list[Feeds]]:
    """Inputs of every graph of the runner's bundle, by the graph's role.

    Raises
    ------
    ConfigError
        If no pair has keypoints in both images, where they are matched.
    """
    manifest = runner.bundle.manifest
    feeds: dict[str, list[Feeds]] = {role: [] for role in manifest.graphs}
    for pair in pairs:
        sides = [runner.encode(image) for image in pair]
        if manifest.kind == "encode-match":
            name = manifest.graphs["encode"].inputs[0]
            feeds["encode"] += [{name: runner.tensor(image)} for image in pair]
        if all(side[0].size for side in sides):
            feeds[runner.last_role].append(runner.feeds(*sides))
        if manifest.kind == "mono":
            more = [runner.encode(image, focal) for image in pair for focal in _FOCALS]
            feeds["mono"] += [runner.feeds(side, side) for side in more]
    if not feeds[runner.last_role]:
        raise ConfigError("no two frames to calibrate on have keypoints", "frames with texture")
    return feeds


def _evenly(available: int, count: int) -> list[int]:
    """Indices of ``count`` of the available ones, or of all."""
    return [int(k) for k in np.linspace(0, available - 1, min(count, available)).round()]


def _read_arrays(path: Path) -> tuple[NDArray[np.uint8], NDArray[np.uint8]]:
    try:
        with np.load(path, allow_pickle=False) as arrays:
            first, second = arrays["IA"], arrays["IB"]
    except (OSError, ValueError, KeyError, zipfile.BadZipFile) as error:
        raise ConfigError(f"no pairs can be read from {path} ({error})", _EXPECTED) from error
    shapes = {first.shape, second.shape}
    if len(shapes) > 1 or first.ndim != 4 or first.shape[3] != 3 or first.dtype != np.uint8:
        raise ConfigError(
            f"IA of {path} is {first.dtype} of {first.shape}, IB {second.shape}",
            "both uint8 (N, H, W, 3)",
        )
    return first, second


def _read_image(path: Path) -> ImageArray:
    image = cv2.imread(str(path), cv2.IMREAD_COLOR)
    if image is None:
        raise ConfigError(f"{path} is no image that can be read", _EXPECTED)
    return cast(ImageArray, cv2.cvtColor(image, cv2.COLOR_BGR2RGB))
