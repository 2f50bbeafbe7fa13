"""Triangles grouped into small neighbourhoods, so that whole groups can be skipped."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from dfvs_core.geometry.arrays import FloatArray
from dfvs_sim.scene.mesh import Int32Array, Scene

_CLUSTER_SIZE = 64
_MORTON_BITS = 10


@dataclass(frozen=True, slots=True, eq=False)
class Clusters:
    """A scene's triangles in the order of a space-filling curve, cut into runs."""

    triangles: Int32Array
    """(M, 3) int32: vertex indices, reordered."""
    texture_index: Int32Array
    """(M,) int32: texture of each triangle, reordered."""
    ranges: Int32Array
    """(C, 2) int32: first and one-past-last triangle of each run."""
    low: FloatArray
    high: FloatArray
    """Both (C, 3) float64: corners of each run's box in NED, m."""


def _spread_bits(x: NDArray[np.uint64]) -> NDArray[np.uint64]:
    """Insert two zero bits after each of the lowest 10 bits."""
    x = (x | (x << np.uint64(16))) & np.uint64(0x030000FF)
    x = (x | (x << np.uint64(8))) & np.uint64(0x0300F00F)
    x = (x | (x << np.uint64(4))) & np.uint64(0x030C30C3)
    x = (x | (x << np.uint64(2))) & np.uint64(0x09249249)
    return x


def _morton_order(points: FloatArray) -> NDArray[np.intp]:
    """Order (M,) of points (M, 3) along a Z-shaped space-filling curve."""
    low, high = points.min(axis=0), points.max(axis=0)
    span = np.maximum(high - low, 1e-9)
    cell = ((points - low) / span * (2**_MORTON_BITS - 1)).astype(np.uint64)
    code = (
        _spread_bits(cell[:, 0])
        | (_spread_bits(cell[:, 1]) << np.uint64(1))
        | (_spread_bits(cell[:, 2]) << np.uint64(2))
    )
    return np.argsort(code, kind="stable")


def build_clusters(scene: Scene) -> Clusters:
    """Sort a scene's triangles along a space-filling curve and box every 64 of them."""
    corners = scene.vertices[scene.triangles].astype(np.float64)
    order = _morton_order(corners.mean(axis=1))
    corners = corners[order]
    starts = np.arange(0, len(order), _CLUSTER_SIZE)
    ends = np.minimum(starts + _CLUSTER_SIZE, len(order))
    return Clusters(
        triangles=np.ascontiguousarray(scene.triangles[order]),
        texture_index=np.ascontiguousarray(scene.texture_index[order]),
        ranges=np.stack([starts, ends], axis=1).astype(np.int32),
        low=np.minimum.reduceat(corners.min(axis=1), starts, axis=0),
        high=np.maximum.reduceat(corners.max(axis=1), starts, axis=0),
    )
