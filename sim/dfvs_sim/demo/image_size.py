"""Images that this machine can compare in time, beside drawing them and flying the vehicle."""

import os
import time
from collections.abc import Callable

import cv2
import numpy as np

from dfvs_common.command_line import parse_size
from dfvs_core.geometry.arrays import ImageArray
from dfvs_models import DEFAULT_MATCHER
from dfvs_models.catalog import load_matcher

SIZES = (("320x240", 28.0), ("256x192", 40.0), ("192x144", np.inf))
"""Image sizes in px, and how long a match of the largest one may take for each, ms."""

RATE_HZ, SHARED_RATE_HZ = 15.0, 10.0
"""Frames a second of one vehicle, and of each of several that share too few cores."""

AUTO = "auto"
SIZE_HELP = "image size in px, or auto: what this machine can compare in time"

_FRAMES = 9
_SHIFT_PX = 3


def service_threads() -> int:
    """Threads for the comparison: one where the simulation needs the only other core."""
    return 1 if (os.cpu_count() or 1) <= 2 else 2


def is_shared(vehicles: int) -> bool:
    """Whether several vehicles have fewer than two cores each."""
    return vehicles > 1 and (os.cpu_count() or 1) < 2 * vehicles


def match_ms() -> float:
    """Time to follow the goal in an image of the largest size, ms: median of a few."""
    matcher = load_matcher(DEFAULT_MATCHER, service_threads())
    image = _image()
    goal = matcher.encode(image)
    moved = np.roll(image, _SHIFT_PX, axis=1)
    flow = matcher.match(matcher.encode(moved), goal)
    times = []
    for _ in range(_FRAMES):
        begin = time.perf_counter()
        matcher.track(matcher.encode(moved), goal, flow)
        times.append(time.perf_counter() - begin)
    return 1000.0 * float(np.median(times))


def affordable_size(taken_ms: float) -> str:
    """Size of the largest images for which a machine is quick enough."""
    return next(size for size, most_ms in SIZES if taken_ms <= most_ms)


def measured_size(log: Callable[[str], None], vehicles: int = 1) -> str:
    """Size of the images by what this machine takes for a match, as ``--size`` takes it."""
    if is_shared(vehicles):
        size = SIZES[-1][0]
        log(f"{vehicles} vehicles on {os.cpu_count()} cores: images of {size} (--size)")
        return size
    taken_ms = match_ms()
    size = affordable_size(taken_ms)
    log(f"{taken_ms:.0f} ms a match on this machine: images of {size} (--size)")
    return size


def _image() -> ImageArray:
    """Image (H, W, 3) with detail at several scales."""
    width, height = parse_size(SIZES[0][0], "--size")
    rng = np.random.default_rng(0)
    total = np.zeros((height, width, 3), np.float32)
    for cells in (10, 20, 40, 80):
        noise = rng.normal(size=(3 * cells // 4, cells, 3)).astype(np.float32)
        total += cv2.resize(noise, (width, height), interpolation=cv2.INTER_CUBIC)
    return np.asarray(np.clip(128.0 + 30.0 * total, 0.0, 255.0), np.uint8)
