"""Random rooms as a soup of textured quadrilaterals: boxes, columns, thin things and sheets.

The world's z points up and the room stands on z = 0. A quadrilateral is a parallelogram
``p = origin + s * edge_u + t * edge_v`` with s, t in [0, 1]; its outside is where
``edge_u x edge_v`` points.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, fields

import torch
from torch import Tensor


@dataclass(frozen=True, slots=True)
class Quads:
    """Quadrilaterals and their material.

    Parameters
    ----------
    origin, edge_u, edge_v : (Q, 3) float32
        Corner and edges, m.
    texture : (Q,) int64
        Index into the texture bank.
    texels_per_m : (Q,) float32
        Texture scale.
    uv_offset : (Q, 2) float32
        Texture offset, texels.
    gloss : (Q,) float32
        Strength of the highlight, 0 for matt.
    two_sided : (Q,) bool
        Seen from behind too.
    """

    origin: Tensor
    edge_u: Tensor
    edge_v: Tensor
    texture: Tensor
    texels_per_m: Tensor
    uv_offset: Tensor
    gloss: Tensor
    two_sided: Tensor

    def select(self, index: Tensor) -> Quads:
        """Return the quadrilaterals of an index or mask."""
        return Quads(*(getattr(self, f.name)[index] for f in fields(self)))


@dataclass(frozen=True, slots=True)
class Boxes:
    """Oriented boxes: centre (N, 3) m, half (N, 3) m, rotation (N, 3, 3) world from box."""

    centre: Tensor
    half: Tensor
    rotation: Tensor

    def hold(self, point: Tensor, margin_m: float) -> bool:
        """Tell whether a point (3,) lies inside any box grown by a margin."""
        local = torch.einsum("nji,nj->ni", self.rotation, point - self.centre)
        return bool((local.abs() < self.half + margin_m).all(dim=1).any())


@dataclass(frozen=True, slots=True)
class Lights:
    """Ambient light and point lamps: position (L, 3) m, power (L,); and a painted shadow wave.

    ``wave`` (3, 2) holds the wave vectors, rad/m, of two smooth shadow patterns in the room and
    ``wave_depth`` (2,) how much light each takes away at most.
    """

    ambient: float
    position: Tensor
    power: Tensor
    wave: Tensor
    wave_depth: Tensor


@dataclass(frozen=True, slots=True)
class Scene:
    """A furnished room: size (3,) m, its quadrilaterals, its solid boxes and its lights."""

    size: Tensor
    quads: Quads
    solids: Boxes
    lights: Lights


_FACE_AXES = torch.tensor([[0, 1, 2], [0, 2, 1], [1, 2, 0], [1, 0, 2], [2, 0, 1], [2, 1, 0]])
"""Per face of a box: the axis of its normal, then those of its edges u and v."""
_FACE_SIGN = torch.tensor([1.0, -1.0, 1.0, -1.0, 1.0, -1.0])


def make_scene(texture_count: int, g: torch.Generator) -> Scene:
    """Draw a room; ``g`` lives on the CPU, and so does the scene."""
    size = torch.tensor([3.0, 3.0, 2.3]) + torch.rand(3, generator=g) * torch.tensor([6, 6, 1.4])
    furniture = _join_boxes(
        [
            _mouldings(size, g),
            _furniture(size, g),
            _thin_things(size, g),
            _wall_panels(size, g),
            _loose_boxes(size, g),
        ]
    )
    surfaces = [_box_faces(_room(size)), _box_faces(furniture), _columns(size, g), _sheets(size, g)]
    edges = [torch.cat([s[k] for s in surfaces]) for k in range(3)]
    two_sided = torch.cat([torch.full((len(s[0]),), k >= 2) for k, s in enumerate(surfaces)])
    quads = _paint(edges, two_sided, texture_count, g)
    return Scene(size, quads, furniture, _lights(size, g))


def _rand(g: torch.Generator, *shape: int, low: float = 0.0, high: float = 1.0) -> Tensor:
    return low + (high - low) * torch.rand(shape, generator=g)


def _count(g: torch.Generator, low: int, high: int) -> int:
    """Draw a whole number in [low, high]."""
    return int(torch.randint(low, high + 1, (), generator=g))


def _room(size: Tensor) -> Boxes:
    """Return the room itself; negative half sizes turn its faces inwards."""
    return Boxes(0.5 * size.unsqueeze(0), -0.5 * size.unsqueeze(0), torch.eye(3).unsqueeze(0))


def _join_boxes(parts: list[Boxes]) -> Boxes:
    return Boxes(
        torch.cat([p.centre for p in parts]),
        torch.cat([p.half for p in parts]),
        torch.cat([p.rotation for p in parts]),
    )


def _yaw_rotation(yaw: Tensor) -> Tensor:
    """Rotations (N, 3, 3) about z by yaw (N,) rad."""
    c, s, o, i = torch.cos(yaw), torch.sin(yaw), torch.zeros_like(yaw), torch.ones_like(yaw)
    return torch.stack([c, -s, o, s, c, o, o, o, i], dim=1).reshape(-1, 3, 3)


def random_rotations(n: int, g: torch.Generator) -> Tensor:
    """Rotations (n, 3, 3) drawn uniformly (QR of a Gaussian matrix, sign fixed)."""
    q, r = torch.linalg.qr(torch.randn(n, 3, 3, generator=g))
    q = q * torch.sign(torch.diagonal(r, dim1=1, dim2=2)).unsqueeze(1)
    rotations: Tensor = q * torch.sign(torch.linalg.det(q)).reshape(-1, 1, 1)
    return rotations


def _furniture(size: Tensor, g: torch.Generator) -> Boxes:
    """Boxes on the floor, most of them along the walls, and smaller ones on top of them."""
    n = _count(g, 6, 14)
    half = 0.5 * torch.exp(_rand(g, n, 3, low=math.log(0.25), high=math.log(1.6)))
    half = torch.minimum(half, 0.3 * size)
    place = _rand(g, n, 2) * (size[:2] - 2 * half[:, :2]) + half[:, :2]
    wall = _rand(g, n) < 0.6
    side = (_rand(g, n) < 0.5).long()
    far = _rand(g, n) < 0.5
    rows = torch.arange(n)[wall]
    axis = side[wall]
    at_wall = torch.where(far[wall], size[axis] - half[rows, axis], half[rows, axis])
    place[rows, axis] = at_wall
    turned = torch.where(wall, torch.zeros(n), _rand(g, n, low=-math.pi, high=math.pi))
    base = Boxes(torch.cat([place, half[:, 2:]], 1), half, _yaw_rotation(turned))
    return _join_boxes([base, _things_on_top(base, g)])


def _things_on_top(base: Boxes, g: torch.Generator) -> Boxes:
    n = _count(g, 2, 16)
    under = torch.randint(0, len(base.half), (n,), generator=g)
    half = 0.5 * torch.exp(_rand(g, n, 3, low=math.log(0.06), high=math.log(0.45)))
    spot = (2 * _rand(g, n, 2) - 1) * base.half[under, :2]
    offset = torch.cat([spot, base.half[under, 2:] + half[:, 2:]], 1)
    centre = base.centre[under] + torch.einsum("nij,nj->ni", base.rotation[under], offset)
    return Boxes(centre, half, _yaw_rotation(_rand(g, n, low=-math.pi, high=math.pi)))


def _thin_things(size: Tensor, g: torch.Generator) -> Boxes:
    """Poles, shelves, legs and frames: one or two sides of a few centimetres."""
    n = _count(g, 0, 9)
    half = 0.5 * torch.exp(_rand(g, n, 3, low=math.log(0.3), high=math.log(2.0)))
    thin = 0.5 * _rand(g, n, 3, low=0.015, high=0.06)
    flat = torch.rand(n, 3, generator=g).argsort(1)
    bars = flat < torch.where(_rand(g, n, 1) < 0.7, 2, 1)
    half = torch.minimum(torch.where(bars, thin, half), 0.45 * size)
    centre = _rand(g, n, 3) * (size - 2 * half) + half
    return Boxes(centre, half, _yaw_rotation((_rand(g, n) < 0.3) * _rand(g, n, high=3.0)))


def _mouldings(size: Tensor, g: torch.Generator) -> Boxes:
    """Skirting boards and cornices: bars along the edges of floor and ceiling, or none."""
    width, depth, height = size.tolist()
    parts: list[list[float]] = []
    for z in (0.0, height):
        if float(_rand(g, 1)) < 0.35:
            continue
        tall, thick = _rand(g, 2, low=0.02, high=0.09).tolist()
        level = z + (tall if z == 0.0 else -tall)
        for x in (0.0, width):
            parts.append([x, 0.5 * depth, level, thick, 0.5 * depth, tall])
        for y in (0.0, depth):
            parts.append([0.5 * width, y, level, 0.5 * width, thick, tall])
    table = torch.tensor(parts).reshape(-1, 6)
    return Boxes(table[:, :3], table[:, 3:], torch.eye(3).expand(len(parts), 3, 3))


def _wall_panels(size: Tensor, g: torch.Generator) -> Boxes:
    """Pictures, windows, doors, rugs and lamps: flat boxes on the room's faces."""
    n = _count(g, 3, 12)
    axis = torch.multinomial(torch.tensor([3.0, 3.0, 1.2]), n, replacement=True, generator=g)
    half = 0.5 * torch.exp(_rand(g, n, 3, low=math.log(0.2), high=math.log(2.2)))
    half = torch.minimum(half, 0.45 * size)
    rows = torch.arange(n)
    half[rows, axis] = _rand(g, n, low=0.005, high=0.03)
    centre = _rand(g, n, 3) * (size - 2 * half) + half
    far = _rand(g, n) < 0.5
    centre[rows, axis] = torch.where(far, size[axis] - half[rows, axis], half[rows, axis])
    return Boxes(centre, half, torch.eye(3).expand(n, 3, 3))


def _loose_boxes(size: Tensor, g: torch.Generator) -> Boxes:
    """Boxes anywhere, turned anyhow."""
    n = _count(g, 0, 5)
    half = 0.5 * torch.exp(_rand(g, n, 3, low=math.log(0.1), high=math.log(0.9)))
    return Boxes(_rand(g, n, 3) * size, half, random_rotations(n, g))


def _box_faces(boxes: Boxes) -> tuple[Tensor, Tensor, Tensor]:
    """Origin, edge u and edge v (6 N, 3 each) of the faces, turned outwards."""
    axes = boxes.rotation.transpose(1, 2) * boxes.half.unsqueeze(2)  # (N, axis, 3)
    normal, u, v = (axes[:, _FACE_AXES[:, k]] for k in range(3))  # (N, 6, 3) each
    sign = _FACE_SIGN.reshape(1, 6, 1)
    centre = boxes.centre.unsqueeze(1) + sign * normal
    origin = centre - u - v
    u, v = 2 * u, 2 * v
    wrong = (torch.linalg.cross(u, v) * sign * normal).sum(-1, keepdim=True) < 0
    inward = (boxes.half < 0).all(1).reshape(-1, 1, 1)
    swap = wrong ^ inward
    u, v = torch.where(swap, v, u), torch.where(swap, u, v)
    return origin.reshape(-1, 3), u.reshape(-1, 3), v.reshape(-1, 3)


def _columns(size: Tensor, g: torch.Generator) -> tuple[Tensor, Tensor, Tensor]:
    """Round things: the sides of upright prisms of eight faces, from lamps to pillars."""
    n, sides = _count(g, 0, 4), 8
    radius = torch.exp(_rand(g, n, 1, low=math.log(0.04), high=math.log(0.35)))
    height = torch.exp(_rand(g, n, 1, low=math.log(0.2), high=math.log(2.0)))
    low = _rand(g, n, 1) * (size[2] - height).clamp(min=0.0) * (_rand(g, n, 1) < 0.5)
    centre = _rand(g, n, 2) * size[:2]
    angle = torch.arange(sides + 1) * (2 * math.pi / sides)
    ring = torch.stack([torch.cos(angle), torch.sin(angle)], 1)  # (9, 2)
    corner = centre.unsqueeze(1) + radius.unsqueeze(1) * ring  # (N, 9, 2)
    bottom = torch.cat([corner, low.unsqueeze(1).expand(-1, sides + 1, 1)], 2)
    origin, edge_u = bottom[:, :-1], bottom[:, 1:] - bottom[:, :-1]
    edge_v = torch.zeros_like(edge_u)
    edge_v[..., 2] = height
    return origin.reshape(-1, 3), edge_u.reshape(-1, 3), edge_v.reshape(-1, 3)


def _sheets(size: Tensor, g: torch.Generator) -> tuple[Tensor, Tensor, Tensor]:
    """Leaves and papers: a cluster of small quadrilaterals, turned anyhow."""
    n = _count(g, 0, 18) if float(_rand(g, 1)) < 0.5 else 0
    heart = _rand(g, 1, 3) * size
    origin = heart + _rand(g, 1).item() * 0.6 * torch.randn(n, 3, generator=g)
    frame = random_rotations(n, g)
    extent = _rand(g, n, 2, 1, low=0.04, high=0.35)
    return origin, frame[:, :, 0] * extent[:, 0], frame[:, :, 1] * extent[:, 1]


def _paint(edges: list[Tensor], two_sided: Tensor, texture_count: int, g: torch.Generator) -> Quads:
    """Give each surface a texture; faces of one thing often share theirs."""
    n = len(two_sided)
    own = torch.randint(0, texture_count, (n,), generator=g)
    shared = own[(torch.arange(n) // 6) * 6 % n]
    texture = torch.where(_rand(g, n) < 0.7, shared, own)
    texture[:4] = texture[0]  # a room's walls look alike
    plain = torch.randint(0, texture_count // 4, (6,), generator=g)
    plain[:4] = plain[0]
    plain_part = _rand(g, 3) < torch.tensor([0.55, 0.25, 0.7])  # walls, floor, ceiling
    plain_face = plain_part[torch.tensor([0, 0, 0, 0, 2, 1])]
    texture[:6] = torch.where(plain_face, plain, texture[:6])
    scale = torch.exp(_rand(g, n, low=math.log(40.0), high=math.log(500.0)))
    gloss = (_rand(g, n) < 0.15) * _rand(g, n, high=0.8)
    offset = _rand(g, n, 2, high=256.0)
    return Quads(edges[0], edges[1], edges[2], texture, scale, offset, gloss, two_sided)


def _lights(size: Tensor, g: torch.Generator) -> Lights:
    n = _count(g, 1, 3)
    position = _rand(g, n, 3, low=0.05, high=0.95) * size
    position[:, 2] = _rand(g, n, low=0.5, high=0.98) * size[2]
    power = _rand(g, n, low=0.2, high=1.6) * (size[2] / 2) ** 2 / n
    wave = torch.randn(3, 2, generator=g) * _rand(g, 1, 2, low=0.5, high=4.0)
    depth = (_rand(g, 2) < 0.6) * _rand(g, 2, high=0.6)
    return Lights(float(_rand(g, 1, low=0.15, high=0.7)), position, power, wave, depth)
