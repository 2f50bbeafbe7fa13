"""Objects of a scene that could be moved: furniture and things, found from the mesh alone."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from dfvs_core.geometry.arrays import BoolArray, FloatArray
from dfvs_sim.scene.mesh import Int32Array, Scene

_WELD_M = 1e-3
_TOUCH_M = 0.01
"""Parts whose bounding boxes come so near to each other move as one."""
_SMALLEST_M, _LARGEST_M = 0.12, 3.0
"""Largest extent of an object; walls, floors and built-in rows are larger."""
_FLAT_M = 0.02
"""Height of a part that is no more than a covering, such as a carpet, which joins nothing."""
_COVER_M = 0.5

_Labels = NDArray[np.int64]


@dataclass(frozen=True, slots=True, eq=False)
class SceneObject:
    """An object: indices (K,) of its vertices, and its bounding box (3,), (3,) in NED, m."""

    vertices: Int32Array
    low: FloatArray
    high: FloatArray

    def holds(self, points: FloatArray) -> BoolArray:
        """Tell which points (N, 3) in NED lie in or on its bounding box."""
        inside = (points >= self.low - _TOUCH_M) & (points <= self.high + _TOUCH_M)
        return np.asarray(inside.all(axis=1))

    def shifted(self, by_m: FloatArray) -> SceneObject:
        """The same with its bounding box moved by (3,) m."""
        return replace(self, low=self.low + by_m, high=self.high + by_m)

    def overlaps(self, other: SceneObject) -> bool:
        """Whether two bounding boxes have a common inside."""
        return bool((self.low < other.high).all() and (other.low < self.high).all())


def find_objects(scene: Scene) -> list[SceneObject]:
    """Objects of a scene: connected parts of the mesh, those that touch taken together.

    A scan, whose mesh is one part, has none.
    """
    label = _connected_parts(scene)
    parts, part_of = np.unique(label, return_inverse=True)
    low, high = np.full((len(parts), 3), np.inf), np.full((len(parts), 3), -np.inf)
    np.minimum.at(low, part_of, scene.vertices)
    np.maximum.at(high, part_of, scene.vertices)
    size = high - low
    is_cover = (size[:, 2] < _FLAT_M) & (size[:, :2].max(axis=1) > _COVER_M)
    small = np.flatnonzero((size.max(axis=1) <= _LARGEST_M) & ~is_cover)
    group = _touching(low[small], high[small])
    found = []
    for name in np.unique(group):
        members = small[group == name]
        box = low[members].min(axis=0), high[members].max(axis=0)
        if _SMALLEST_M <= (box[1] - box[0]).max() <= _LARGEST_M:
            vertices = np.flatnonzero(np.isin(part_of, members)).astype(np.int32)
            found.append(SceneObject(vertices, *box))
    return found


def move_vertices(scene: Scene, vertices: Int32Array, by_m: FloatArray) -> Scene:
    """The scene with some vertices (K,) moved by (3,) m; the baked light stays as it was."""
    moved = scene.vertices.copy()
    moved[vertices] += by_m.astype(np.float32)
    return replace(scene, vertices=moved)


def _connected_parts(scene: Scene) -> _Labels:
    """Label (N,) of the connected part that each vertex belongs to."""
    welded = np.rint(scene.vertices.astype(np.float64) / _WELD_M).astype(np.int64)
    _, place = np.unique(welded, axis=0, return_inverse=True)
    corners = place.reshape(-1)[scene.triangles]
    label = _propagated(int(place.max()) + 1, corners)
    return label[place.reshape(-1)]


def _touching(low: FloatArray, high: FloatArray) -> _Labels:
    """Label (N,) of the group of touching boxes (N, 3), (N, 3) that each box belongs to."""
    near = np.ones((len(low), len(low)), np.bool_)
    for k in range(low.shape[1]):
        near &= low[:, None, k] - _TOUCH_M <= high[None, :, k]
    return _propagated(len(low), np.argwhere(near & near.T))


def _propagated(count: int, edges: NDArray[np.int64]) -> _Labels:
    """Least index (count,) among all that are connected by edges (M, 2 or more)."""
    label = np.arange(count)
    while True:
        least = label[edges].min(axis=1)
        lower = label.copy()
        for k in range(edges.shape[1]):
            np.minimum.at(lower, edges[:, k], least)
        lower = lower[lower]
        if (lower == label).all():
            return label
        label = lower
