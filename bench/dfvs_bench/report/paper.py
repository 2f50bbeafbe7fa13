"""What the DFVS paper reports in its Table I and of its Fig. 6, to stand beside our figures.

Its scenes are scans seen in another simulator, so the numbers are for scale and not for a ranking.
"""

from __future__ import annotations

from dataclasses import dataclass

PAPER_COLUMNS = ("PhotoVS", "Saxena et al.", "true depth", "depth network", "flow depth")


@dataclass(frozen=True, slots=True)
class PaperScene:
    """A scene of Table I, in the order of ``PAPER_COLUMNS``; None stands for "NC".

    Parameters
    ----------
    initial : tuple of float
        m, degrees.
    translation_m, rotation_deg : tuple of float
        Final errors.
    path_m, iterations : tuple
        Length of the trajectory, and number of iterations.
    """

    initial: tuple[float, float]
    translation_m: tuple[float, ...]
    rotation_deg: tuple[float, ...]
    path_m: tuple[float | None, ...]
    iterations: tuple[int | None, ...]


PAPER_SCENES = (
    PaperScene(
        (1.42, 18.20),
        (0.06, 0.19, 0.02, 0.02, 0.04),
        (0.76, 0.89, 0.37, 0.38, 0.72),
        (2.26, 2.69, 2.24, 1.42, 1.19),
        (956, 1486, 764, 233, 1560),
    ),
    PaperScene(
        (1.49, 16.33),
        (0.12, 0.08, 0.04, 0.02, 0.03),
        (0.66, 0.84, 0.84, 0.42, 0.06),
        (2.22, 2.48, 1.58, 1.55, 2.31),
        (869, 1687, 150, 143, 871),
    ),
    PaperScene(
        (1.41, 18.07),
        (0.28, 0.13, 0.03, 0.02, 0.04),
        (3.23, 6.44, 8.72, 8.87, 8.39),
        (None, 2.94, 2.31, 1.19, 1.1),
        (None, 1647, 214, 185, 580),
    ),
    PaperScene(
        (1.15, 17.27),
        (0.91, 0.83, 0.02, 0.02, 0.02),
        (13.25, 10.54, 1.39, 1.38, 0.66),
        (None, None, 1.52, 2.56, 0.89),
        (None, None, 104, 186, 3831),
    ),
    PaperScene(
        (1.64, 30.96),
        (0.33, 0.04, 0.03, 0.03, 0.03),
        (3.57, 1.39, 0.85, 0.83, 0.89),
        (None, 2.86, 2.36, 3.65, 2.37),
        (None, 1235, 84, 89, 869),
    ),
    PaperScene(
        (1.37, 17.26),
        (1.29, 1.25, 0.02, 0.02, 0.03),
        (7.63, 9.55, 1.81, 0.77, 1.81),
        (None, None, 1.33, 2.49, 1.26),
        (None, None, 20, 283, 661),
    ),
    PaperScene(
        (1.95, 22.86),
        (0.54, 0.35, 0.02, 0.02, 0.03),
        (4.56, 6.47, 0.53, 0.53, 1.39),
        (None, None, 2.74, 2.82, 1.85),
        (None, None, 62, 244, 981),
    ),
    PaperScene(
        (2.54, 20.02),
        (2.49, 2.32, 0.02, 0.01, 0.03),
        (39.65, 48.77, 11.67, 0.34, 0.55),
        (None, None, 2.03, 5.88, 2.26),
        (None, None, 504, 237, 754),
    ),
    PaperScene(
        (1.94, 31.78),
        (2.36, 2.27, 0.04, 0.041, 0.041),
        (43.37, 29.69, 0.78, 0.75, 0.91),
        (None, None, 2.24, 2.28, 2.32),
        (None, None, 183, 145, 1124),
    ),
    PaperScene(
        (2.43, 36.05),
        (2.27, 1.36, 0.01, 0.01, 0.02),
        (53.246, 29.24, 0.28, 0.16, 0.49),
        (None, None, 2.52, 2.67, 3.52),
        (None, None, 314, 114, 1386),
    ),
)
"""Rows of Table I."""


@dataclass(frozen=True, slots=True)
class PaperBasin:
    """What the paper's text says of a rotation set out to 4 m: a ratio, and its own words."""

    ratio: float
    words: str


PAPER_BASIN = {
    (20.0, 20.0, 40.0): PaperBasin(0.90, "about 90 percent"),
    (30.0, 30.0, 50.0): PaperBasin(0.75, "over 75 percent in most cases"),
}
"""Flow-depth, by rotation about x, y and z in degrees; sixteen environments a point."""
