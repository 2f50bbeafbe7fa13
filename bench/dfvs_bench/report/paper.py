"""What the DFVS paper reports in its Table I and of its Fig. 6, to stand beside our figures.

Its scenes are scans seen in another simulator, so the numbers are for scale and not for a ranking.
"""

import functools
from dataclasses import dataclass
from pathlib import Path

from dfvs_bench.trials.documents import read_document

_TABLE1 = Path(__file__).resolve().parent.parent / "assets" / "paper_table1.json"

PAPER_COLUMNS = ("PhotoVS", "Saxena et al.", "true depth", "depth network", "flow depth")


@dataclass(frozen=True, slots=True)
class PaperScene:
    """A scene of Table I, in the order of ``PAPER_COLUMNS``; None stands for "NC"."""

    initial: tuple[float, float]
    """m, degrees."""
    translation_m: tuple[float, ...]
    rotation_deg: tuple[float, ...]
    """Both are final errors."""
    path_m: tuple[float | None, ...]
    iterations: tuple[int | None, ...]


@dataclass(frozen=True, slots=True)
class _Table1:
    scenes: tuple[PaperScene, ...]


@functools.cache
def paper_scenes() -> tuple[PaperScene, ...]:
    """Rows of Table I."""
    return read_document(_Table1, _TABLE1, str(_TABLE1), "a file of this package").scenes


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
