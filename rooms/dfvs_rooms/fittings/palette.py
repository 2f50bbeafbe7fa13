"""Colours that go together: every place takes its paints, woods and cloths from one palette."""

from dataclasses import dataclass

from dfvs_rooms.surfaces.textures import OAK, WALNUT, Colour

BIRCH: tuple[Colour, ...] = ((0.87, 0.75, 0.57), (0.81, 0.67, 0.48), (0.70, 0.55, 0.37))
CHERRY: tuple[Colour, ...] = ((0.64, 0.38, 0.24), (0.55, 0.30, 0.18), (0.42, 0.21, 0.12))


@dataclass(frozen=True, slots=True)
class Palette:
    """Colours of one place.

    Parameters
    ----------
    walls : tuple of Colour
        Wall paints.
    wood : tuple of Colour
        From the light to the dark of the wood that most furniture is of.
    front : Colour
        Painted doors and furniture.
    cloth, accent : Colour
        Upholstery; cushions, patterns, things to be noticed.
    """

    walls: tuple[Colour, ...]
    wood: tuple[Colour, ...]
    front: Colour
    cloth: Colour
    accent: Colour


PALETTES = (
    Palette(
        ((0.90, 0.87, 0.80), (0.86, 0.82, 0.74)), OAK, (0.52, 0.60, 0.52), (0.36, 0.42, 0.46),
        (0.74, 0.42, 0.22),
    ),
    Palette(
        ((0.89, 0.89, 0.87), (0.72, 0.76, 0.78)), BIRCH, (0.24, 0.34, 0.44), (0.62, 0.60, 0.56),
        (0.82, 0.64, 0.22),
    ),
    Palette(
        ((0.91, 0.90, 0.87), (0.74, 0.78, 0.70)), WALNUT, (0.88, 0.87, 0.83), (0.44, 0.50, 0.40),
        (0.64, 0.26, 0.20),
    ),
    Palette(
        ((0.92, 0.88, 0.80), (0.84, 0.66, 0.52)), OAK, (0.76, 0.72, 0.64), (0.58, 0.34, 0.26),
        (0.16, 0.36, 0.40),
    ),
    Palette(
        ((0.90, 0.89, 0.86), (0.62, 0.66, 0.70)), CHERRY, (0.36, 0.40, 0.40), (0.24, 0.30, 0.40),
        (0.78, 0.50, 0.40),
    ),
    Palette(
        ((0.93, 0.91, 0.84), (0.88, 0.80, 0.58)), BIRCH, (0.40, 0.52, 0.56), (0.72, 0.66, 0.54),
        (0.50, 0.22, 0.30),
    ),
)  # fmt: skip
