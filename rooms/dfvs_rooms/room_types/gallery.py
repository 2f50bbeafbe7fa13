"""A gallery on two levels: a staircase and a landing in a high hall, paintings and sculptures."""

import numpy as np

from dfvs_rooms.fittings import shell
from dfvs_rooms.fittings.shell import EAST, NORTH, SOUTH, WEST, Finish
from dfvs_rooms.generator import interior_furniture as pieces
from dfvs_rooms.generator import props
from dfvs_rooms.generator.layout import Layout, Piece
from dfvs_rooms.generator.solids import Part, box, cushion, lathe, placed, sphere, tilted, tube

_LEVEL_M, _LANDING_M, _SLAB_M = 2.55, 1.5, 0.2
_STEPS, _TREAD_M, _STAIR_WIDTH_M = 15, 0.28, 1.15
_RAIL_M = 0.95


def gallery(rng: np.random.Generator) -> Layout:
    """Furnish a gallery."""
    layout = shell.drawn_layout(rng, (7.6, 9.0), (6.4, 7.2), (4.9, 5.3))
    floor = str(rng.choice(["parquet", "terrazzo", "planks"]))
    shell.build_shell(layout, Finish(floor, ("wall0", "wall0", "wall1", "bricks")), edge_m=0.13)
    _stairs_and_landing(layout)
    shell.add_windows(layout, SOUTH, (-2.3, 0.0, 2.3), 3.8, (1.5, 1.3), panes=3)
    layout.stand(Piece.standing(props.door(1.2, 2.3, "walnut", "black")), SOUTH, 2.4)
    _paintings(layout, rng)
    for x, y in ((0.2, -1.0), (1.9, 0.3), (2.4, -1.9)):
        layout.set_down(_sculpture(rng), x + float(rng.uniform(-0.3, 0.3)), y)
    layout.set_down(_bench(), 0.6, 0.5)
    layout.set_down(_screen_of_artworks(rng), -0.4, -2.2, float(rng.uniform(-12, 12)))
    shell.scatter(layout, rng, (pieces.plant, pieces.seat), 3)
    shell.hang_lamps(layout, (3, 2), 1.1)
    return layout


def _stairs_and_landing(layout: Layout) -> None:
    """Landing along the north wall, and a flight of stairs along the west wall up to it."""
    (e, n) = (float(v) for v in layout.half)
    edge = n - _LANDING_M
    slab = (0.0, n - _LANDING_M / 2, _LEVEL_M - _SLAB_M)
    layout.parts += box((2 * e, _LANDING_M, _SLAB_M), slab, "concrete", skip="-x +x +y")
    floor = (0.0, n - _LANDING_M / 2, _LEVEL_M)
    layout.parts += box((2 * e, _LANDING_M, 0.01), floor, "oak", skip="-x +x +y -z")
    run = _STEPS * _TREAD_M
    layout.stand(Piece.standing(_stairs()), WEST, edge - run / 2)
    layout.parts += placed(_balustrade(2 * e - _STAIR_WIDTH_M), _STAIR_WIDTH_M / 2, edge, _LEVEL_M)
    for x in (-0.3 * e, 0.35 * e):
        column = lathe([(0.11, 0.0), (0.11, _LEVEL_M - _SLAB_M)], "metal", sides=20)
        layout.parts += placed([column], x, edge + 0.15)


def _stairs() -> list[Part]:
    """Flight of stairs that rises to +x, its wall side at +y, with a handrail."""
    rise = _LEVEL_M / _STEPS
    run = _STEPS * _TREAD_M
    parts: list[Part] = []
    for k in range(_STEPS):
        x, high = (k + 0.5) * _TREAD_M - run / 2, (k + 1) * rise
        body = (_TREAD_M, _STAIR_WIDTH_M, high - 0.035)
        parts += box(body, (x, 0, 0), "concrete", skip="-z +z", edge_m=0.15)
        tread = (_TREAD_M + 0.03, _STAIR_WIDTH_M, 0.035)
        parts += box(tread, (x - 0.015, 0, high - 0.035), "oak", skip="-z +x")
        post = (x, -_STAIR_WIDTH_M / 2 + 0.05, high)
        parts.append(tube(post, (x, post[1], high + _RAIL_M), 0.009, "black", sides=6))
    y = -_STAIR_WIDTH_M / 2 + 0.05
    low, top = (-run / 2, y, rise + _RAIL_M), (run / 2, y, _LEVEL_M + rise + _RAIL_M - 0.17)
    return [*parts, tube(low, top, 0.028, "oak", sides=10)]


def _balustrade(length: float) -> list[Part]:
    """Posts and a rail along x, standing at the origin."""
    parts = box((length, 0.06, 0.05), (0, 0.04, _RAIL_M), "oak")
    for x in np.linspace(-length / 2 + 0.05, length / 2 - 0.05, int(length / 0.14)):
        post = (float(x), 0.04, 0.0)
        parts.append(tube(post, (post[0], 0.04, _RAIL_M), 0.009, "black", sides=6, edge_m=0.5))
    return parts


def _paintings(layout: Layout, rng: np.random.Generator) -> None:
    """Paintings of all sizes on both levels; no two alike."""
    frames = ("brass", "black", "walnut", "white")
    number = 0
    for k, height, count in ((NORTH, 1.35, 5), (EAST, 1.7, 4), (SOUTH, 1.75, 4), (NORTH, 4.0, 6),
                             (EAST, 3.7, 3), (WEST, 3.9, 3)):  # fmt: skip
        row = []
        for _ in range(count):
            size = float(rng.uniform(0.6, 1.25)), float(rng.uniform(0.55, 1.0))
            frame = frames[int(rng.integers(len(frames)))]
            row.append(shell.framed(f"picture{number}", size, frame))
            number += 1
        shell.hang_row(layout, k, row, height)


def _sculpture(rng: np.random.Generator) -> Piece:
    """Something of stone or metal on a plinth."""
    parts = box((0.5, 0.5, 0.95), (0, 0, 0), "white", skip="-z")
    label = box((0.16, 0.006, 0.1), (0, -0.253, 0.75), "brass", skip="+y", edge_m=0.2)
    kind = int(rng.integers(4))
    if kind == 0:
        wave = [(0.16 + 0.08 * np.sin(5 * t), 0.75 * t) for t in np.linspace(0, 1, 22)]
        shape = [lathe(wave, "marble", sides=28)]
    elif kind == 1:
        around = np.linspace(0, 2 * np.pi, 17)
        ring = [(0.24 + 0.08 * np.cos(a), 0.08 * np.sin(a)) for a in around]
        torus = tilted(lathe(ring, "accent", sides=36), (1, 0, 0), 80)
        shape = placed([torus, sphere(0.12, (0, 0, 0), "brass")], 0, 0, 0.34)
    elif kind == 2:
        shape = []
        for k in range(5):
            side = 0.3 - 0.045 * k
            shape += placed(box((side, side, 0.16), (0, 0, 0), "marble"), 0, 0, 0.16 * k, 18.0 * k)
    else:
        shape = cushion((0.34, 0.22, 0.4), (0, 0, 0), "clay", power=2.4)
        shape += placed([sphere(0.13, (0, 0, 0), "clay")], 0.03, 0, 0.5)
    return Piece.standing(parts + label + placed(shape, 0, 0, 0.95))


def _bench() -> Piece:
    parts = cushion((1.6, 0.5, 0.12), (0, 0, 0.34), "leather", power=9)
    for x in (-0.65, 0.65):
        parts += box((0.06, 0.44, 0.34), (x, 0, 0), "metal", skip="-z")
    return Piece.standing(parts)


def _screen_of_artworks(rng: np.random.Generator) -> Piece:
    """Free-standing wall with artworks on both sides."""
    parts = box((2.4, 0.16, 2.1), (0, 0, 0), "wall2", skip="-z")
    for side, turn in ((-1, 0.0), (1, 180.0)):
        for j, x in enumerate((-0.65, 0.55)):
            name = f"picture{30 + 2 * j + (side > 0)}"
            size = float(rng.uniform(0.5, 0.9)), float(rng.uniform(0.5, 0.9))
            hung = props.framed_artwork(*size, name, "black")
            parts += placed(hung, x, side * 0.082, 1.35, turn)
    return Piece.standing(parts)
