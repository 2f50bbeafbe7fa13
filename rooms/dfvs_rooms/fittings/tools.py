"""Tools and machines of a workshop. Hand tools hang at the origin with their backs at y = 0."""

from collections.abc import Callable
from functools import partial

import numpy as np

from dfvs_rooms.generator.solids import Part, box, corners, disc, lathe, placed, sheet, tilted, tube


def hammer() -> list[Part]:
    """Hammer, head up."""
    parts = [tube((0, -0.03, -0.16), (0, -0.03, 0.1), (0.016, 0.012), "oak", sides=8)]
    return parts + box((0.12, 0.03, 0.035), (0, -0.03, 0.1), "metal", edge_m=0.2)


def spanner(length_m: float) -> list[Part]:
    """Open-ended spanner."""
    parts = box((0.02, 0.008, length_m), (0, -0.02, -length_m / 2), "steel", edge_m=0.3)
    for end in (-1, 1):
        ring = lathe([(0.012, -0.005), (0.024, -0.005), (0.024, 0.005), (0.012, 0.005)], "steel")
        parts += placed([tilted(ring, (1, 0, 0), 90)], 0, -0.02, end * length_m / 2)
    return parts


def screwdriver(handle: str) -> list[Part]:
    """Screwdriver, point down."""
    grip = tube((0, -0.03, 0.0), (0, -0.03, 0.1), (0.012, 0.016), handle, sides=8)
    return [grip, tube((0, -0.03, -0.13), (0, -0.03, 0.0), 0.004, "steel", sides=6)]


def saw() -> list[Part]:
    """Hand saw, hung by its handle."""
    s = np.linspace(0.0, 1.0, 5)[None, :]
    t = np.linspace(0.0, 1.0, 2)[:, None]
    x = 0.06 + 0.42 * s + 0 * t
    z = (t - 1.0) * (0.12 - 0.07 * s)
    points = np.stack([x, np.full_like(x, -0.02), z], -1)
    parts = [sheet(points, np.stack([x, -z], -1), "steel")]
    grip = lathe([(0.022, -0.012), (0.06, -0.012), (0.06, 0.012), (0.022, 0.012)], "walnut")
    return parts + placed([tilted(grip, (1, 0, 0), 90)], 0.02, -0.025, -0.05)


def clamp() -> list[Part]:
    """Bar clamp."""
    parts = box((0.02, 0.01, 0.6), (0, -0.02, -0.3), "metal", edge_m=0.3)
    parts += box((0.03, 0.09, 0.03), (0, -0.06, 0.25), "red", edge_m=0.3)
    parts += box((0.03, 0.09, 0.03), (0, -0.06, -0.05), "red", edge_m=0.3)
    return [*parts, tube((0, -0.09, -0.25), (0, -0.09, -0.05), 0.013, "oak", sides=8)]


def hose() -> list[Part]:
    """Coil of cable on a hook."""
    parts = []
    for k in range(4):
        around = np.linspace(0, 2 * np.pi, 25)
        radius = 0.16 - 0.012 * k
        ring = lathe(
            [(radius + 0.012 * np.cos(a), 0.012 * np.sin(a)) for a in around[::4]],
            "accent" if k % 2 else "black",
            sides=28,
        )
        parts += placed([tilted(ring, (1, 0, 0), 90)], 0, -0.03 - 0.02 * k, -0.16)
    return parts


def square_rule() -> list[Part]:
    """Carpenter's square."""
    parts = box((0.3, 0.004, 0.04), (0.13, -0.02, -0.02), "steel", edge_m=0.3)
    return parts + box((0.03, 0.015, 0.18), (0, -0.02, -0.16), "walnut", edge_m=0.3)


def tool_wall(rng: np.random.Generator, width_m: float, height_m: float) -> list[Part]:
    """Pegboard full of tools, its middle at the origin."""
    parts = box((width_m, 0.02, height_m), (0, -0.01, -height_m / 2), "pegboard", skip="+y")
    for row, z in enumerate(np.linspace(height_m / 2 - 0.2, -height_m / 2 + 0.25, 2)):
        x = -width_m / 2 + 0.15
        while x < width_m / 2 - 0.2:
            kind = int(rng.integers(7))
            size = float(rng.uniform(0.16, 0.3))
            make, wide = _hanging(kind, size, low=bool(row))
            if x + wide < width_m / 2:
                parts += placed(make(), x + (0.19 if make is hose else 0.0), -0.02, float(z))
            x += wide + 0.03
    return parts


def _hanging(kind: int, size: float, *, low: bool) -> tuple[Callable[[], list[Part]], float]:
    """Maker of one of seven tools and the width that it takes; clamps hang in the lower row."""
    choices: tuple[tuple[Callable[[], list[Part]], float], ...] = (
        (hammer, 0.18),
        (partial(spanner, size), 0.1),
        (partial(screwdriver, "red"), 0.08),
        (saw, 0.55),
        (clamp if low else partial(screwdriver, "accent"), 0.1),
        (square_rule, 0.34),
        (hose, 0.38),
    )
    return choices[kind]


def workbench(width_m: float) -> list[Part]:
    """Heavy bench with a vice and a shelf of boards below, its back at y = 0.35."""
    parts = box((width_m, 0.7, 0.07), (0, 0, 0.83), "oak")
    for leg in corners(width_m / 2 - 0.1, 0.26):
        parts += box((0.1, 0.1, 0.83), (*leg, 0), "oak", skip="-z +z")
    parts += box((width_m - 0.2, 0.6, 0.025), (0, 0, 0.25), "chipboard")
    jaw = (-width_m / 2 + 0.35, -0.4, 0.72)
    parts += box((0.26, 0.06, 0.2), jaw, "red", edge_m=0.2)
    parts += box((0.26, 0.04, 0.2), (jaw[0], -0.5, 0.72), "metal", edge_m=0.2)
    parts.append(tube((jaw[0], -0.35, 0.8), (jaw[0], -0.62, 0.8), 0.016, "steel", sides=8))
    left, right = (jaw[0] - 0.12, -0.6, 0.8), (jaw[0] + 0.12, -0.6, 0.8)
    return [*parts, tube(left, right, 0.008, "steel", sides=6)]


def drill_press() -> list[Part]:
    """Pillar drill on the floor."""
    parts = box((0.42, 0.6, 0.06), (0, 0, 0), "metal", skip="-z")
    parts.append(tube((0, 0.14, 0.05), (0, 0.14, 1.72), 0.045, "steel", sides=14))
    parts += box((0.4, 0.36, 0.04), (0, -0.1, 0.88), "metal")
    parts += box((0.26, 0.56, 0.3), (0, 0.02, 1.42), "accent")
    parts += box((0.22, 0.3, 0.14), (0, 0.12, 1.72), "black")
    parts.append(tube((0, -0.16, 1.14), (0, -0.16, 1.42), (0.012, 0.04), "steel", sides=10))
    for angle in np.radians([10, 130, 250]):
        end = (0.15, -0.02 + 0.2 * np.cos(angle), 1.5 + 0.2 * np.sin(angle))
        parts.append(tube((0.14, -0.02, 1.5), end, 0.008, "steel", sides=6))
    return parts


def tool_cabinet() -> list[Part]:
    """Red cabinet of drawers on castors."""
    parts = box((0.72, 0.46, 0.8), (0, 0, 0.12), "red")
    heights = (0.08, 0.08, 0.1, 0.1, 0.14, 0.2)
    for k, h in enumerate(heights):
        z = 0.86 - sum(heights[: k + 1]) - 0.01 * k
        parts += box((0.66, 0.02, h), (0, -0.24, z), "red", skip="+y", edge_m=0.2)
        parts += box((0.5, 0.015, 0.015), (0, -0.258, z + h - 0.03), "steel", edge_m=0.3)
    for castor in corners(0.28, 0.15):
        parts.append(tube((*castor, 0.0), (*castor, 0.12), 0.03, "black", sides=10))
    return parts


def leaning_boards(rng: np.random.Generator, count: int) -> list[Part]:
    """Boards and battens that lean against a wall at y = 0."""
    parts = []
    for k in range(count):
        width, high = float(rng.uniform(0.06, 0.22)), float(rng.uniform(1.5, 2.2))
        wood = str(rng.choice(["oak", "walnut", "chipboard", "planks"]))
        lean = float(rng.uniform(5, 12))
        board = [tilted(p, (1, 0, 0), -lean) for p in box((width, 0.025, high), (0, 0, 0), wood)]
        out = -high * np.sin(np.radians(lean)) - 0.02
        parts += placed(board, 0.14 * k, float(out), 0.012)
    return parts


def step_ladder(height_m: float) -> list[Part]:
    """Folding ladder, open."""
    parts = []
    reach = 0.22 * height_m
    for x in (-1, 1):
        top = (x * 0.18, 0.0, height_m)
        for y in (-reach, reach):
            parts.append(tube((x * 0.26, y, 0.0), top, 0.018, "accent", sides=8))
    for t in np.linspace(0.18, 0.92, round(height_m / 0.28)):
        wide = 2 * (0.26 - 0.08 * t)
        parts += box((wide, 0.09, 0.022), (0, -reach * (1 - t), t * height_m), "oak", edge_m=0.2)
    return parts


def barrel(colour: str) -> list[Part]:
    """Drum of sheet metal with two hoops."""
    r, h = 0.29, 0.88
    profile = [(r, 0.0), (r, 0.29), (r + 0.012, 0.3), (r, 0.31), (r, 0.58), (r + 0.012, 0.59)]
    profile += [(r, 0.6), (r, h), (r - 0.02, h)]
    return [lathe(profile, colour, sides=28), disc(r - 0.015, (0, 0, h - 0.012), colour)]
