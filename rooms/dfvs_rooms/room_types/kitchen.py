"""A kitchen: fitted cupboards in an L, a table or an island, tiles, jars and pans."""

from dataclasses import replace

import numpy as np

from dfvs_rooms.fittings import cupboards, shell
from dfvs_rooms.fittings.cupboards import TOP_M, UNIT_M
from dfvs_rooms.fittings.shell import EAST, NORTH, SOUTH, WEST, Finish
from dfvs_rooms.generator import furniture, props
from dfvs_rooms.generator import interior_furniture as pieces
from dfvs_rooms.generator.layout import Layout, Piece
from dfvs_rooms.generator.solids import Part, box, cushion, disc, lathe, placed, tube


def kitchen(rng: np.random.Generator) -> Layout:
    """Furnish a kitchen."""
    layout = shell.drawn_layout(rng, (4.4, 5.6), (3.8, 4.6), (2.5, 2.8))
    floor = str(rng.choice(["checkers", "flagstone", "planks", "parquet"]))
    shell.build_shell(layout, Finish(floor, ("wall0", "wall0", "wall1", "wall0")))
    _fittings(layout, rng)
    place = (float(rng.uniform(-0.8, 0.8)), 1.5)
    shell.add_window(layout, WEST, place, (1.4, 1.3))
    layout.stand(Piece.standing(props.door(0.9, 2.05, "white", "white")), SOUTH, 1.0)
    layout.stand(pieces.sideboard(rng), SOUTH, -0.8)
    layout.set_down(_table(rng), -0.5, -0.35, float(rng.choice([0.0, 90.0])))
    shell.hang_row(layout, SOUTH, [_poster(rng, k) for k in range(4)], 1.65)
    shell.scatter(layout, rng, (pieces.plant, pieces.basket, pieces.seat), 3)
    shell.hang_lamps(layout, (2, 1), 0.75, shade=str(rng.choice(["accent", "sage", "black"])))
    return layout


def _fittings(layout: Layout, rng: np.random.Generator) -> None:
    """Cupboards along the north wall and round the north-east corner, and what is over them."""
    reach = layout.walls[NORTH].length_m / 2
    plan = ["unit"] * int((2 * reach - 0.75) / UNIT_M)
    plan[1], plan[-2] = "sink", "oven"
    run = cupboards.run_of_units(rng, plan)
    width = UNIT_M * len(plan)
    middle = reach - width / 2 - 0.01
    layout.stand(Piece.standing(run), NORTH, middle)
    layout.stand(Piece.standing(cupboards.fridge()), NORTH, middle - width / 2 - 0.36)
    side = cupboards.run_of_units(rng, ["unit"] * 3)
    layout.stand(Piece.standing(side), EAST, -layout.walls[EAST].length_m / 2 + 1.55)
    left = middle - width / 2
    shell.clad(layout, NORTH, (left, reach, TOP_M, 1.5), "subway")
    at_oven, at_sink = left + UNIT_M * (len(plan) - 1.5), left + UNIT_M * 1.5
    layout.hang(Piece.hanging(cupboards.hood()), NORTH, at_oven, 1.95)
    shell.add_window(layout, NORTH, (at_sink, 1.68), (0.95, 0.85))
    count = int((at_oven - at_sink - 0.5 - 0.55) / UNIT_M)
    if count > 0:
        units = Piece.hanging(cupboards.wall_units(rng, count))
        layout.hang(units, NORTH, 0.5 * (at_oven + at_sink) + 0.02, 1.86)
    layout.parts += shell.on_wall(layout, NORTH, _rail_of_pans(), at_oven - 0.05, 1.38)
    layout.parts += shell.on_wall(layout, NORTH, _worktop_things(rng), left + 2.1, TOP_M)
    layout.parts += shell.on_wall(layout, EAST, _worktop_things(rng), -0.5 - reach * 0.1, TOP_M)
    _shelves(layout, rng)


def _shelves(layout: Layout, rng: np.random.Generator) -> None:
    """Two open shelves of jars and plates over the shorter run."""
    s = -layout.walls[EAST].length_m / 2 + 1.55
    shell.clad(layout, EAST, (s - 1.5, s + 0.92, TOP_M, 1.45), "subway")
    for z in (1.55, 1.9):
        parts = cupboards.open_shelf(1.5, "oak")
        for x in np.arange(-0.66, 0.7, 0.125):
            parts += placed(_kept_thing(rng), float(x), -0.12)
        layout.parts += shell.on_wall(layout, EAST, parts, s + 0.1, z)
    layout.hang(shell.framed("picture1", (0.5, 0.66), "oak"), EAST, s + 1.75, 1.6)


def _kept_thing(rng: np.random.Generator) -> list[Part]:
    kind = int(rng.integers(4))
    if kind < 2:
        return shell.drawn_tin(rng, (0.04, 0.055), (0.1, 0.2), 5)
    if kind == 2:
        radius = 0.055
        stack: list[Part] = []
        for k in range(int(rng.integers(3, 8))):
            plate = lathe([(0.03, 0.0), (radius, 0.014), (radius, 0.018), (0.005, 0.008)], "glaze")
            stack += placed([plate], 0, 0, 0.014 * k)
        return stack
    return [props.vase(float(rng.uniform(0.14, 0.2)), str(rng.choice(["clay", "glaze"])))]


def _worktop_things(rng: np.random.Generator) -> list[Part]:
    """Board, kettle, bowl, crock of spoons and a plant in a row, backs to the wall."""
    parts = placed(box((0.34, 0.02, 0.46), (0, 0, 0), "walnut"), -0.55, -0.05, 0.0)
    body = [(0.085, 0.0), (0.09, 0.03), (0.07, 0.15), (0.03, 0.18), (0.008, 0.2)]
    parts += placed([lathe(body, "accent")], -0.2, -0.25)
    parts.append(tube((-0.27, -0.25, 0.12), (-0.34, -0.25, 0.17), (0.02, 0.012), "accent"))
    parts += placed(props.fruit_bowl(rng), 0.1, -0.3)
    parts += placed([lathe([(0.05, 0.0), (0.055, 0.14), (0.045, 0.14)], "clay")], 0.42, -0.16)
    for k in range(5):
        lean = rng.uniform(-0.05, 0.05, 2)
        top = (0.42 + float(lean[0]), -0.16 + float(lean[1]), 0.3)
        parts.append(tube((0.42, -0.16, 0.02), top, 0.006, "oak", sides=6))
        parts += cushion((0.04, 0.02, 0.07), top, "oak" if k % 2 else "steel", power=3)
    return parts + placed(props.palm(rng, 0.26, pot_radius=0.08), 0.68, -0.2)


def _rail_of_pans() -> list[Part]:
    """Rail with pans and ladles on hooks, under the hood's level."""
    parts = [tube((-0.45, -0.05, 0), (0.45, -0.05, 0), 0.008, "steel", sides=6)]
    for x, radius in ((-0.34, 0.09), (-0.1, 0.075), (0.12, 0.065), (0.32, 0.055)):
        pan = lathe([(0.004, -0.02), (radius, -0.02), (1.1 * radius, 0.03)], "black", is_sheet=True)
        upright = np.array([[1, 0, 0], [0, 0, 1], [0, 1, 0]], dtype=float)
        turned = replace(pan, vertices=pan.vertices @ upright.T, normals=pan.normals @ upright.T)
        parts += placed([turned], x, -0.06, -0.14 - radius)
        parts.append(tube((x, -0.05, -0.15), (x, -0.05, 0), 0.007, "black", sides=6))
    return parts


def _table(rng: np.random.Generator) -> Piece:
    """Dining table with chairs, or an island with stools."""
    if rng.random() < 0.55:
        return pieces.dining_table(rng)
    parts = box((1.5, 0.8, 0.86), (0, 0, 0), "sage", skip="-z")
    parts += box((1.62, 0.94, 0.04), (0, 0, 0.86), "worktop")
    for x in (-0.5, 0.0, 0.5):
        parts += placed(cupboards.front(0.48, 0.78, "sage"), x, -0.4, 0.04)
        parts += placed(cupboards.stool("oak"), x, 0.62)
    parts += placed(props.fruit_bowl(rng), 0.35, 0.05, 0.9)
    parts += placed(furniture.book_pile(rng, 4, "books"), -0.4, 0.0, 0.9)
    parts += placed([props.vase(0.28, "glaze"), disc(0.1, (0, 0, 0.005), "linen")], 0.0, 0.1, 0.9)
    return Piece.standing(parts)


def _poster(rng: np.random.Generator, k: int) -> Piece:
    name = str(rng.choice([f"poster{k}", f"picture{k}"]))
    return shell.framed(name, (0.42, 0.58), str(rng.choice(["oak", "black", "white"])))
