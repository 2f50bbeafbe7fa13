"""Floors, walls, windows and lamps of the places, and where things are put by plan."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from dfvs_rooms.generator import interior_furniture as pieces
from dfvs_rooms.generator import props
from dfvs_rooms.generator.interior import window
from dfvs_rooms.generator.layout import Layout, Piece, evenly
from dfvs_rooms.generator.solids import Part, box, lathe, panel, placed, sphere, tube

NORTH, EAST, SOUTH, WEST = range(4)
_SKIRTING_M = 0.016


@dataclass(frozen=True, slots=True)
class Finish:
    """Materials of a shell; an empty name stands for none."""

    floor: str
    walls: tuple[str, str, str, str]
    """North, east, south and west."""
    ceiling: str = "ceiling"
    skirting: str = "white"


def drawn_layout(
    rng: np.random.Generator,
    length_m: tuple[float, float],
    width_m: tuple[float, float],
    height_m: tuple[float, float],
) -> Layout:
    """Empty layout of a size drawn from ranges."""
    length, width, height = (float(rng.uniform(*r)) for r in (length_m, width_m, height_m))
    return Layout((length, width, height), rng)


def build_shell(layout: Layout, finish: Finish, edge_m: float = 0.12) -> None:
    """Add floor, four walls, and ceiling and skirting where there are any."""
    (e, n), h = (float(v) for v in layout.half), layout.height_m
    add = layout.parts.append
    add(panel((-e, -n, 0), (2 * e, 0, 0), (0, 2 * n, 0), finish.floor, edge_m=edge_m))
    if finish.ceiling:
        add(panel((-e, n, h), (2 * e, 0, 0), (0, -2 * n, 0), finish.ceiling, edge_m=1.5 * edge_m))
    for k, material in enumerate(finish.walls):
        reach = layout.walls[k].length_m / 2
        side = panel((-reach, 0, 0), (2 * reach, 0, 0), (0, 0, h), material, edge_m=edge_m)
        add(on_wall(layout, k, [side])[0])
        if finish.skirting:
            clad(layout, k, (-reach, reach, 0.0, 0.09), finish.skirting, _SKIRTING_M)


def on_wall(
    layout: Layout, k: int, parts: Iterable[Part], s: float = 0.0, z: float = 0.0
) -> list[Part]:
    """Move parts that hang at the origin to a place (s, z) on wall k."""
    wall = layout.walls[k]
    return placed(placed(parts, s, wall.distance_m, z), 0, 0, 0, wall.turn_deg)


def clad(
    layout: Layout,
    k: int,
    area: tuple[float, float, float, float],
    material: str,
    thick_m: float = 0.012,
) -> None:
    """Put a slab on wall k, over (s from, to, z from, to), m; it takes no place from furniture."""
    left, right, low, high = area
    size = (right - left, thick_m, high - low)
    slab = box(size, ((left + right) / 2, -thick_m / 2, low), material, skip="+y", edge_m=0.12)
    layout.parts += on_wall(layout, k, slab)


def add_window(
    layout: Layout,
    k: int,
    place_m: tuple[float, float],
    size_m: tuple[float, float],
    panes: int = 2,
) -> None:
    """Add a window at (s, z) of wall k; nothing where something hangs already."""
    piece = Piece(tuple(window(*size_m, panes)), size_m[0] + 0.1, 0.2, size_m[1] / 2 + 0.06)
    if layout.hang(piece, k, *place_m):
        layout.let_in_light(k, place_m, size_m)


def add_windows(  # noqa: PLR0913
    layout: Layout,
    k: int,
    places_m: Sequence[float],
    height_m: float,
    size_m: tuple[float, float],
    panes: int,
) -> None:
    """Add equal windows at places along wall k, all at one height."""
    for s in places_m:
        add_window(layout, k, (s, height_m), size_m, panes)


def add_curtains(
    layout: Layout, k: int, place_m: tuple[float, float], width_m: float, rng: np.random.Generator
) -> None:
    """Hang gathered curtains beside a window of a width, from above it to the floor."""
    top = min(place_m[1] + 1.0, layout.height_m - 0.12)
    parts = placed(props.curtain_rail(width_m + 1.0), 0, -0.12, top)
    for side in (-1, 1):
        cloth = props.curtain(rng, 0.42, top - 0.02)
        parts += placed(cloth, side * (width_m / 2 + 0.2), -0.12)
    layout.parts += on_wall(layout, k, parts, place_m[0])


def hang_row(layout: Layout, k: int, draws: Sequence[Piece], height_m: float) -> None:
    """Hang pieces side by side along wall k, as far as there is room."""
    wall = layout.walls[k]
    for s, piece in zip(evenly(wall.length_m, len(draws)), draws, strict=True):
        layout.hang(piece, k, s, height_m)


def scatter(
    layout: Layout, rng: np.random.Generator, draws: Sequence[pieces.Draw], count: int
) -> None:
    """Stand drawn things along the walls, where there is room."""
    for _ in range(count):
        layout.against_wall(draws[int(rng.integers(len(draws)))](rng))


def hang_lamps(layout: Layout, grid: tuple[int, int], drop_m: float, shade: str = "") -> None:
    """Hang lamps under the ceiling on a grid, with shades of enamel or opal globes."""
    lamp = enamel_lamp(drop_m, shade) if shade else props.pendant_lamp(drop_m, 0.14)
    layout.hang_lamps(lamp, *grid)


def enamel_lamp(drop_m: float, enamel: str) -> list[Part]:
    """Bulb under a bell of sheet metal, which hangs below the origin."""
    bulb = replace(sphere(0.075, (0, 0, -drop_m), "globe", sides=18), emission=3.5)
    bell = [(0.24, -0.06), (0.22, 0.0), (0.15, 0.08), (0.06, 0.13), (0.05, 0.2)]
    shade = lathe([(r, z - drop_m) for r, z in bell], enamel, sides=28, is_sheet=True)
    return [bulb, shade, tube((0, 0, 0.2 - drop_m), (0, 0, 0), 0.007, "black", sides=6)]


def framed(artwork: str, size_m: tuple[float, float], frame: str = "black") -> Piece:
    """Artwork of a size in a frame."""
    return Piece.hanging(props.framed_artwork(*size_m, artwork, frame))


def drawn_tin(
    rng: np.random.Generator,
    radius_m: tuple[float, float],
    height_m: tuple[float, float],
    labels: int,
) -> list[Part]:
    """Tin or jar of a drawn size, one of some labels all around it, turned anyhow."""
    radius, height = float(rng.uniform(*radius_m)), float(rng.uniform(*height_m))
    body = lathe([(radius, 0.0), (radius, height)], f"label{rng.integers(labels)}", sides=16)
    turn = np.linspace(0.0, 1.0, 17)
    uv = np.stack([np.tile(turn, 2), np.repeat([1.0, 0.0], 17)], 1)
    lid = [(radius, height), (0.97 * radius, height + 0.006), (0.003, height + 0.006)]
    parts = [replace(body, uv=uv), lathe(lid, "steel", sides=16)]
    return placed(parts, 0, 0, 0, float(rng.uniform(0, 360)))
