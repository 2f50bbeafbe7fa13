"""A courtyard: four house fronts around paving, plants and a fountain, open to the sky."""

import numpy as np

from dfvs_rooms.fittings import greenery, shell
from dfvs_rooms.fittings.shell import EAST, NORTH, SOUTH, WEST, Finish
from dfvs_rooms.generator import props
from dfvs_rooms.generator.layout import Layout, Piece
from dfvs_rooms.generator.room import Sky
from dfvs_rooms.generator.solids import Part, box, cushion, disc, lathe, panel, placed, sheet, tube

_DOME_M = 14.0


def courtyard(rng: np.random.Generator) -> Layout:
    """Build and plant a courtyard."""
    layout = shell.drawn_layout(rng, (8.0, 9.6), (6.6, 7.8), (4.2, 4.8))
    walls = ("bricks", "stucco", "stone", "wall0")
    floor = str(rng.choice(["paving", "cobbles"]))
    shell.build_shell(layout, Finish(floor, walls, ceiling="", skirting=""), edge_m=0.1)
    for k in (NORTH, EAST, SOUTH, WEST):
        shell.clad(layout, k, (-_reach(layout, k), _reach(layout, k), 0, 0.35), "stone", 0.04)
        _eaves(layout, k)
    _fronts(layout, rng)
    _garden(layout, rng)
    layout.parts.append(_dome())
    layout.sky = Sky(float(rng.uniform(0, 360)), float(rng.uniform(48, 62)))
    return layout


def _reach(layout: Layout, k: int) -> float:
    return layout.walls[k].length_m / 2


def _eaves(layout: Layout, k: int) -> None:
    """Edge of the roof: a sloping strip of tiles and a gutter."""
    reach, h = _reach(layout, k), layout.height_m
    strip = panel((-reach, -0.4, h - 0.22), (2 * reach, 0, 0), (0, 0.62, 0.4), "roof")
    under = panel((-reach, 0, h - 0.24), (2 * reach, 0, 0), (0, -0.4, 0), "oak")
    gutter = tube((-reach, -0.42, h - 0.24), (reach, -0.42, h - 0.24), 0.05, "metal", sides=10)
    layout.parts += shell.on_wall(layout, k, [strip, under, gutter])


def _fronts(layout: Layout, rng: np.random.Generator) -> None:
    """Doors, shuttered windows, lanterns and climbers."""
    for k in (NORTH, EAST, SOUTH, WEST):
        count = 3 if k in (NORTH, SOUTH) else 2
        with_door = int(rng.integers(count)) if k != SOUTH else -1
        for j in range(count):
            s = 2 * _reach(layout, k) * ((j + 0.5) / count - 0.5)
            if j == with_door:
                layout.stand(Piece.standing(props.door(1.0, 2.1, "sage", "stone")), k, s)
                layout.hang(Piece.hanging(_lantern()), k, s + 0.85, 2.2)
            else:
                layout.hang(Piece.hanging(_shuttered_window(rng)), k, s, 1.75)
            layout.hang(Piece.hanging(_shuttered_window(rng, 0.8)), k, s, 3.3)
    for k in (EAST, SOUTH):
        place = float(rng.uniform(-0.4, 0.4)) * _reach(layout, k)
        growth = greenery.climber(rng, 2.4, layout.height_m - 0.5, 1300, "leaf0")
        layout.parts += shell.on_wall(layout, k, growth, place)


def _shuttered_window(rng: np.random.Generator, height: float = 1.2) -> list[Part]:
    """Window with panes, a stone sill, shutters and perhaps a box of flowers."""
    width = 0.8
    glass = panel((-width / 2, -0.005, -height / 2), (width, 0, 0), (0, 0, height), "pane")
    parts = [glass]
    for x in (-width / 2, 0.0, width / 2):
        parts += box((0.05, 0.04, height), (x, -0.02, -height / 2), "white", skip="+y")
    for z in (-height / 2, 0.0, height / 2 - 0.05):
        parts += box((width, 0.035, 0.05), (0, -0.018, z), "white", skip="+y")
    parts += box((width + 0.2, 0.14, 0.06), (0, -0.07, -height / 2 - 0.06), "stone", skip="+y")
    for side in (-1, 1):
        at = (side * (width / 2 + 0.24), -0.025, -height / 2)
        parts += box((0.4, 0.03, height), at, "wainscot", skip="+y")
        for z in (-0.32 * height, 0.28 * height):
            bar = (at[0], -0.048, z)
            parts += box((0.38, 0.018, 0.07), bar, "sage", skip="+y", edge_m=0.2)
    if rng.random() < 0.6:
        parts += box((0.8, 0.18, 0.17), (0, -0.16, -height / 2), "clay")
        parts += placed(_flowers(rng, 0.75, 0.16), 0, -0.17, -height / 2 + 0.17)
    return parts


def _flowers(rng: np.random.Generator, width: float, depth: float) -> list[Part]:
    """Low leaves with blossoms among them, on a bed around the origin."""
    count = int(900 * width * depth) + 40
    low, high = (-width / 2, -depth / 2, 0.0), (width / 2, depth / 2, 0.2)
    places = rng.uniform(low, high, (count, 3))
    up = np.tile([0.0, -0.4, 1.0], (count, 1))
    parts = [greenery.leaves(rng, places, up, "leaf1", 0.07)]
    bloom = rng.uniform((low[0], low[1], 0.12), (high[0], high[1], 0.26), (count // 3, 3))
    return [*parts, greenery.leaves(rng, bloom, up[: len(bloom)], "blossom", 0.05)]


def _lantern() -> list[Part]:
    parts = box((0.14, 0.03, 0.24), (0, -0.015, -0.12), "black", skip="+y")
    parts += box((0.03, 0.16, 0.03), (0, -0.1, 0.06), "black")
    parts.append(
        lathe([(0.05, -0.14), (0.085, 0.04), (0.02, 0.1)], "white", sides=6).moved(0, -0.2)
    )
    return [*parts, lathe([(0.1, 0.03), (0.02, 0.12)], "black", sides=6).moved(0, -0.2)]


def _garden(layout: Layout, rng: np.random.Generator) -> None:
    """Fountain, raised beds, a table, benches, tubs and pots."""
    layout.set_down(Piece.standing(_fountain()), float(rng.uniform(-1.2, 1.2)), 0.3)
    layout.stand(_raised_bed(rng, 3.0), NORTH, -0.2 * _reach(layout, NORTH))
    layout.stand(_raised_bed(rng, 2.4), WEST, 0.3 * _reach(layout, WEST))
    layout.set_down(_table(rng), -2.3, -1.9, float(rng.uniform(-20, 20)))
    trees = ((3.1, -2.1), (-3.2, 2.0))
    for x, y in trees:
        layout.set_down(_planted_tree(rng), x, y)
    for _ in range(2):
        layout.against_wall(_bench())
    for _ in range(7):
        radius = float(rng.uniform(0.16, 0.26))
        clay = str(rng.choice(["clay", "glaze"]))
        tub = greenery.tub(rng, radius, clay, f"leaf{rng.integers(2)}")
        layout.against_wall(Piece.standing(tub))
    for _ in range(4):
        pot = props.palm(rng, float(rng.uniform(0.35, 0.6)))
        layout.against_wall(Piece.standing(pot))
    barrel = lathe([(0.24, 0.0), (0.3, 0.35), (0.3, 0.45), (0.25, 0.8)], "oak", sides=24)
    layout.against_wall(Piece.standing([barrel, disc(0.24, (0, 0, 0.76), "pane")]))


def _fountain() -> list[Part]:
    """Round basin of stone with a bowl on a column."""
    rim = [(0.95, 0.0), (1.0, 0.08), (0.92, 0.1), (0.92, 0.42), (1.02, 0.44), (1.02, 0.52)]
    basin = [*rim, (0.82, 0.52), (0.82, 0.3)]
    column = [(0.24, 0.2), (0.2, 0.3), (0.11, 0.5), (0.1, 0.85), (0.16, 0.95), (0.5, 1.1)]
    bowl = [*column, (0.56, 1.16), (0.5, 1.15), (0.1, 1.05)]
    ball = [(0.08, 1.05), (0.06, 1.25), (0.13, 1.32), (0.12, 1.42), (0.01, 1.48)]
    parts = [lathe(shape, "flagstone", sides=32) for shape in (basin, bowl, ball)]
    return [*parts, disc(0.83, (0, 0, 0.38), "pane", sides=32)]


def _raised_bed(rng: np.random.Generator, width: float) -> Piece:
    """Bed walled with bricks, full of shrubs and flowers."""
    deep, high = 0.75, 0.42
    parts = box((width, deep, high), (0, 0, 0), "bricks", skip="-z")
    parts += box((width - 0.16, deep - 0.16, 0.01), (0, 0, high), "earth", skip="-z")
    for x in np.linspace(-0.38, 0.38, 4) * width:
        bush = greenery.shrub(rng, float(rng.uniform(0.5, 0.7)), float(rng.uniform(0.5, 0.9)),
                              f"leaf{rng.integers(2)}")  # fmt: skip
        parts += placed(bush, float(x), 0.05, high)
    return Piece.standing(parts + placed(_flowers(rng, width - 0.3, 0.22), 0, -0.24, high))


def _planted_tree(rng: np.random.Generator) -> Piece:
    parts = box((1.0, 1.0, 0.3), (0, 0, 0), "stone", skip="-z")
    parts += box((0.8, 0.8, 0.01), (0, 0, 0.3), "gravel", skip="-z")
    parts += placed(greenery.tree(rng, float(rng.uniform(2.4, 3.0)), "leaf0"), 0, 0, 0.3)
    piece = Piece.standing(parts)
    return Piece(piece.parts, 1.1, 1.1, piece.height_m)


def _bench() -> Piece:
    """Wooden garden bench."""
    parts: list[Part] = []
    for y in (-0.16, -0.03, 0.1):
        parts += box((1.5, 0.11, 0.03), (0, y, 0.42), "oak")
    for z in (0.58, 0.73):
        parts += box((1.5, 0.03, 0.1), (0, 0.2, z), "oak")
    for x in (-0.66, 0.66):
        parts += box((0.06, 0.06, 0.42), (x, -0.16, 0), "metal", skip="-z")
        parts += box((0.06, 0.06, 0.85), (x, 0.23, 0), "metal", skip="-z")
    return Piece.standing(parts)


def _table(rng: np.random.Generator) -> Piece:
    """Round metal table with chairs, cushions and a pot."""
    top = [(0.02, 0.7), (0.48, 0.7), (0.5, 0.72), (0.48, 0.735), (0.01, 0.735)]
    parts = [lathe(top, "accent", sides=30), tube((0, 0, 0), (0, 0, 0.7), 0.03, "metal")]
    parts += placed(props.palm(rng, 0.25, pot_radius=0.08), 0.1, 0.1, 0.735)
    for angle in np.radians([20, 140, 260]):
        turn = float(np.degrees(angle)) - 90.0
        place = float(0.85 * np.cos(angle)), float(0.85 * np.sin(angle))
        parts += placed(_garden_chair(), *place, 0.0, turn)
    return Piece.standing(parts)


def _garden_chair() -> list[Part]:
    parts = cushion((0.42, 0.42, 0.06), (0, 0, 0.42), "print", power=6)
    for x in (-0.19, 0.19):
        parts.append(tube((x, -0.19, 0), (x, -0.17, 0.42), 0.012, "accent", sides=7))
        parts.append(tube((x, 0.2, 0), (x, 0.24, 0.9), 0.012, "accent", sides=7))
    for z in (0.6, 0.72, 0.84):
        parts += box((0.38, 0.012, 0.05), (0, 0.225, z), "accent", edge_m=0.2)
    return parts


def _dome() -> Part:
    """Sky all around, seen from inside."""
    azimuth = np.linspace(0.0, 2 * np.pi, 49)[None, :]
    height = np.linspace(0.0, 0.5 * np.pi - 1e-3, 13)[:, None]
    level = np.cos(height)
    points = np.stack(
        np.broadcast_arrays(
            _DOME_M * level * np.cos(azimuth),
            _DOME_M * level * np.sin(azimuth),
            _DOME_M * np.sin(height) + 0 * azimuth,
        ),
        -1,
    )
    uv = np.stack(
        np.broadcast_arrays(azimuth / (2 * np.pi), 1.0 - height / (0.5 * np.pi) + 0 * azimuth), -1
    )
    return sheet(points, uv, "sky")
