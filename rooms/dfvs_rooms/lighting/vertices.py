"""Where light is measured: at the vertices of what does not shine, on every side of a part."""

import numpy as np

from dfvs_core.geometry.arrays import FloatArray
from dfvs_rooms.generator.room import Room
from dfvs_rooms.generator.solids import Part


def lit_parts(room: Room) -> list[Part]:
    """Parts that light falls on."""
    return [part for part in room.parts if not room.materials[part.material].shines]


def side_points(parts: list[Part]) -> tuple[FloatArray, FloatArray]:
    """Points (N, 3) at the vertices of parts, away from their borders, and unit normals (N, 3)."""
    points, normals = [], []
    for part in parts:
        pulled = _pulled_inwards(part)
        for side in _sides(part):
            points.append(pulled)
            normals.append(side * part.normals)
    return np.concatenate(points), np.concatenate(normals)


def means_of_sides(parts: list[Part], values: FloatArray) -> list[FloatArray]:
    """Values (N, 3) at the points of all sides as means (V, 3) at the vertices of each part."""
    means, at = [], 0
    for part in parts:
        shape = (len(_sides(part)), len(part.vertices), 3)
        count = shape[0] * shape[1]
        means.append(values[at : at + count].reshape(shape).mean(axis=0))
        at += count
    return means


def at_all_parts(room: Room, values: FloatArray) -> list[FloatArray]:
    """Values (N, 3) at the points of :func:`lit_parts` for every part of a room; 0 on lights."""
    lit = lit_parts(room)
    means = {id(p): mean for p, mean in zip(lit, means_of_sides(lit, values), strict=True)}
    return [means.get(id(part), np.zeros_like(part.vertices)) for part in room.parts]


def _sides(part: Part) -> tuple[float, ...]:
    """Sides on which light falls, as signs of the normal."""
    return (1.0, -1.0) if part.is_sheet else (1.0,)


def _pulled_inwards(part: Part) -> FloatArray:
    """Vertices moved along the surface towards their triangles, so away from its borders."""
    middle = part.vertices[part.triangles].mean(axis=1)
    total, count = np.zeros_like(part.vertices), np.zeros(len(part.vertices))
    for k in range(3):
        np.add.at(total, part.triangles[:, k], middle)
        np.add.at(count, part.triangles[:, k], 1.0)
    towards = total / np.maximum(count, 1.0)[:, None] - part.vertices
    towards -= np.sum(towards * part.normals, axis=1, keepdims=True) * part.normals
    return part.vertices + np.where(count[:, None] > 0, 0.2 * towards, 0.0)
