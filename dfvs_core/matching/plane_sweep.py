"""A search along epipolar lines for what a first match has not found.

A match finds the surface that fills most of the picture; a floor, a side wall or a column in
front of it moves quite differently. But what is sure tells how the camera has moved, and then every
other point is on a known line of the other picture. So that picture is warped by a family of
planes, one after the other (Collins 1996), each pixel is compared with all of them, and the choice
made smooth. What is sure stays, and where it leads to is taken.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import cast

import cv2
import numpy as np
from numpy.typing import NDArray

from dfvs_core.arrays import Float32Array, FloatArray, ImageArray
from dfvs_core.correspondence import FlowField
from dfvs_core.matching.epipolar import EpipolarGeometry, fit_epipolar, sure_points
from dfvs_core.matching.semi_global import smooth_costs
from dfvs_core.matching.warping import landing_places, pixel_grid, sample

_WORKING_WIDTH_PX = 160
_REACH, _STEP = 0.25, 0.01
"""How far from the plane that most is on, and in what steps: shares of the picture's width."""
_SURE = 0.5
_SURE_MISS_PX = 1.5

_COLOUR_SHARE = 0.7
_COLOUR_GREY = 20.0
_PATCH = (3, 3)
_FAINT_GREY2 = 2.0
_OUTSIDE_COST = 0.68
_TAKEN_COST = 0.4
_SURE_COST_PER_STEP, _SURE_COST = 0.15, 0.6
_GAIN_LIMITS = (0.5, 2.0)
_TAKEN_BORDER = np.ones((5, 5), np.uint8)

_DISTINCT_STEPS = 2
_DISTINCT_COST = 0.7
_GOOD_COST, _BAD_COST = 0.4, 0.75


@dataclass(frozen=True, slots=True)
class _Scaled:
    """Both pictures (h, w, 3) float32 at working size, the second in the first one's colours.

    ``at`` (h, w, 2) is where its pixels are in the whole picture, px; ``taken`` (h, w) is 1
    where something sure leads to in the second.
    """

    first: Float32Array
    second: Float32Array
    taken: Float32Array
    at: Float32Array


def plane_sweep(current: ImageArray, other: ImageArray, field: FlowField) -> FlowField | None:
    """Flow of everything in ``current`` (H, W, 3) RGB, by the epipolar geometry of a flow.

    Its confidence says how distinct each pixel's place on its line is, and how alike the pictures
    are there. It is good to some pixels: refine it. None where what is sure of ``field`` is too
    little, or does not agree on the camera's motion.
    """
    geometry = fit_epipolar(field)
    if geometry is None:
        return None
    scaled = _scale(current, other, field)
    labels = _labels(geometry, field)
    costs = _compare(scaled, geometry, labels)
    _hold_sure(costs, field, geometry, labels, scaled.at)
    summed = smooth_costs(costs, _mean_colour(scaled.first))
    best = summed.argmin(axis=0)
    parallax = labels[0] + (labels[1] - labels[0]) * _between(summed, best)
    parallax = cv2.medianBlur(parallax.astype(np.float32), 5)
    trust = _trust(costs, summed, best)
    whole = (current.shape[1], current.shape[0])
    swept = FlowField(geometry.flow(_enlarge(parallax, whole)), _enlarge(trust, whole))
    return swept if swept.is_finite() else None


def _scale(current: ImageArray, other: ImageArray, field: FlowField) -> _Scaled:
    height, width = current.shape[:2]
    scale = min(1.0, _WORKING_WIDTH_PX / width)
    small = (max(8, round(width * scale)), max(8, round(height * scale)))
    per_px = np.array([width / small[0], height / small[1]], np.float32)
    at = (pixel_grid(small[::-1]) + np.float32(0.5)) * per_px - np.float32(0.5)
    return _Scaled(
        _shrink(current.astype(np.float32), small),
        _shrink(_in_colours_of(current, other, field), small),
        _shrink(_taken(field), small),
        at,
    )


def _shrink(values: Float32Array, size: tuple[int, int]) -> Float32Array:
    return np.asarray(cv2.resize(values, size, interpolation=cv2.INTER_AREA), np.float32)


def _enlarge(values: Float32Array, size: tuple[int, int]) -> Float32Array:
    return np.asarray(cv2.resize(values, size, interpolation=cv2.INTER_NEAREST), np.float32)


def _mean_colour(picture: Float32Array) -> Float32Array:
    return np.asarray(cv2.transform(picture, np.full((1, 3), 1.0 / 3.0)), np.float32)


def _in_colours_of(current: ImageArray, other: ImageArray, field: FlowField) -> Float32Array:
    """``other`` (H, W, 3) with each channel's gain and offset fitted over what is sure."""
    at, to = sure_points(field, 4)
    u, v = at.astype(np.intp).T
    x = sample(other, to.astype(np.float32)[None])[0].astype(np.float32)
    y = current[v, u].astype(np.float32)
    gain = np.clip((y.std(axis=0) + 4.0) / (x.std(axis=0) + 4.0), *_GAIN_LIMITS)
    offset = np.median(y - gain * x, axis=0)
    return np.asarray(other * gain + offset, np.float32)


def _taken(field: FlowField) -> Float32Array:
    """(H, W) in the other picture: 1 where the sure flow leads to, holes closed, borders off."""
    closed = cv2.morphologyEx(landing_places(field, _SURE), cv2.MORPH_CLOSE, _TAKEN_BORDER)
    return np.asarray(cv2.erode(closed, _TAKEN_BORDER), np.float32)


def _labels(geometry: EpipolarGeometry, field: FlowField) -> FloatArray:
    """Parallaxes (D,) to try: even steps about that of the sure points."""
    known = geometry.parallax(*sure_points(field, 4))
    width = field.confidence.shape[1]
    count = round(_REACH / _STEP)
    step = _STEP * width / max(float(np.median(known.px)), 1e-6)
    return np.asarray(float(np.median(known.value)) + step * np.arange(-count, count + 1))


def _compare(scaled: _Scaled, geometry: EpipolarGeometry, labels: FloatArray) -> Float32Array:
    """Cost (D, h, w) of every parallax: colours that differ, patches that do not correlate."""
    first = scaled.first
    second = np.dstack([scaled.second, scaled.taken])
    height, width = first.shape[:2]
    half, per_px = np.float32(0.5), np.float32(width / geometry.size[1])
    grey = _mean_colour(first)
    mean, spread = _moments(grey)
    on_plane = geometry.on_plane(scaled.at)
    costs = np.empty((len(labels), height, width), np.float32)
    for k, label in enumerate(labels):
        place, in_front = geometry.places(on_plane, float(label))
        at = (place + half) * per_px - half
        inside = in_front & (at >= 0.0).all(-1) & (at <= (width - 1, height - 1)).all(-1)
        warped = sample(second, at)
        brought = np.ascontiguousarray(warped[..., :3])
        other = _mean_colour(brought)
        other_mean, other_spread = _moments(other)
        shared = cv2.blur(grey * other, _PATCH) - mean * other_mean
        unlike = 1.0 - np.clip(shared / (spread * other_spread), 0.0, 1.0)
        apart = cv2.blur(_mean_colour(np.abs(first - brought)), _PATCH) / _COLOUR_GREY
        cost = (1.0 - _COLOUR_SHARE) * unlike + _COLOUR_SHARE * np.minimum(apart, 1.0)
        costs[k] = np.where(inside, cost + _TAKEN_COST * warped[..., 3], _OUTSIDE_COST)
    return costs


def _moments(grey: Float32Array) -> tuple[Float32Array, Float32Array]:
    """Mean and spread (h, w) of each pixel's patch."""
    mean = cv2.blur(grey, _PATCH)
    square = np.maximum(cv2.blur(grey * grey, _PATCH) - mean * mean, 0.0)
    return cast(Float32Array, mean), cast(Float32Array, np.sqrt(square + _FAINT_GREY2))


def _hold_sure(
    costs: Float32Array,
    field: FlowField,
    geometry: EpipolarGeometry,
    labels: FloatArray,
    at: Float32Array,
) -> None:
    """Raise the costs of sure pixels' parallaxes by their distance from the known one."""
    u, v = np.round(at).astype(np.intp).reshape(-1, 2).T
    from_px = np.stack([u, v], axis=-1).astype(np.float64)
    known = geometry.parallax(from_px, from_px + field.flow[v, u])
    sure = (field.confidence[v, u] > _SURE) & (known.miss_px < _SURE_MISS_PX)
    steps = np.abs(labels[:, None] - known.value[sure]) / (labels[1] - labels[0])
    flat = costs.reshape(len(labels), -1)
    flat[:, sure] = 0.3 * flat[:, sure] + np.minimum(_SURE_COST_PER_STEP * steps, _SURE_COST)


def _between(summed: Float32Array, best: NDArray[np.intp]) -> FloatArray:
    """Label (h, w) with the vertex of the parabola through the best one and its neighbours."""
    k = np.clip(best, 1, len(summed) - 2)[None]
    low, middle, high = (np.take_along_axis(summed, k + j, axis=0)[0] for j in (-1, 0, 1))
    bend = np.maximum(low - 2.0 * middle + high, 1e-6)
    return np.asarray(k[0] + np.clip(0.5 * (low - high) / bend, -0.5, 0.5), np.float64)


def _trust(costs: Float32Array, summed: Float32Array, best: NDArray[np.intp]) -> Float32Array:
    """How far the best label (h, w) can be trusted, 0 to 1."""
    label = np.arange(len(summed), dtype=np.int16)[:, None, None]
    far = np.abs(label - best.astype(np.int16)) > _DISTINCT_STEPS
    second = np.where(far, summed, np.inf).min(axis=0)
    margin = second - np.take_along_axis(summed, best[None], axis=0)[0]
    distinct = 1.0 / (1.0 + (_DISTINCT_COST / np.maximum(margin, 1e-3)) ** 2)
    cost = cv2.blur(np.take_along_axis(costs, best[None], axis=0)[0], (5, 5))
    alike = np.clip((_BAD_COST - cost) / (_BAD_COST - _GOOD_COST), 0.0, 1.0)
    return np.asarray(distinct * alike, np.float32)
