"""Convergence ratios of the basin, and how sure they are: by method, rotation and translation."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from dfvs_bench.basin.drawing import LEAST_OVERLAP
from dfvs_bench.basin.outcomes import Outcome
from dfvs_bench.trials.statistics import mean, rounded
from dfvs_bench.trials.tables import row
from dfvs_bench.trials.tables import summarise as summarise_trials

_DIGITS = 4
_Z_95 = 1.959963984540054
"""Two-sided 95 % of the normal distribution."""

Rotation = tuple[float, float, float]


@dataclass(frozen=True, slots=True)
class Share:
    """A share of successes with its 95 % confidence interval; 0 <= successes <= trials."""

    successes: int
    trials: int

    @property
    def ratio(self) -> float:
        """Share of successes; NaN without trials."""
        return self.successes / self.trials if self.trials else math.nan

    @property
    def interval(self) -> tuple[float, float]:
        """Wilson's score interval (J. Am. Stat. Assoc. 22, 1927); (0, 1) without trials.

        Unlike the textbook's interval it stays within 0 and 1, and keeps its width where every
        trial succeeded.
        """
        if not self.trials:
            return 0.0, 1.0
        n, p, z2 = self.trials, self.ratio, _Z_95**2
        middle = (p + z2 / (2 * n)) / (1 + z2 / n)
        half = _Z_95 * math.sqrt(p * (1 - p) / n + z2 / (4 * n * n)) / (1 + z2 / n)
        return max(0.0, middle - half), min(1.0, middle + half)


@dataclass(frozen=True, slots=True)
class Curve:
    """One line of Fig. 6."""

    method: str
    rotation_deg: Rotation
    overlapping: bool
    """Over the tasks whose start sees enough of the goal, or else over all that were drawn freely.
    """
    outcomes: tuple[Outcome, ...]

    @property
    def share(self) -> Share:
        """Of all its trials."""
        return share(self.outcomes)

    @property
    def mean_ratio(self) -> float:
        """Mean of the translations' ratios; NaN without trials."""
        return float(np.mean([share(group).ratio for group in self.points.values()] or [math.nan]))

    @property
    def points(self) -> dict[float, tuple[Outcome, ...]]:
        """Trials by translation in m, from near to far."""
        distances = sorted({o.drawn.cell.translation_m for o in self.outcomes})
        return {
            d: tuple(o for o in self.outcomes if o.drawn.cell.translation_m == d) for d in distances
        }


def share(outcomes: Sequence[Outcome]) -> Share:
    """Share of trials that converged."""
    return Share(sum(o.record.trial.converged for o in outcomes), len(outcomes))


def curves(outcomes: Sequence[Outcome]) -> list[Curve]:
    """Two lines for every method and rotation set: of all tasks, and of those with overlap."""
    methods = list(dict.fromkeys(o.record.method for o in outcomes))
    rotations = sorted({o.drawn.cell.rotation_deg for o in outcomes})
    found = []
    for method in methods:
        for rotation in rotations:
            group = [
                o
                for o in outcomes
                if o.record.method == method and o.drawn.cell.rotation_deg == rotation
            ]
            free = tuple(o for o in group if o.drawn.freely)
            overlapping = tuple(o for o in group if o.drawn.overlaps)
            found += [Curve(method, rotation, False, free)]
            found += [Curve(method, rotation, True, overlapping)]
    return found


def summarise(outcomes: Sequence[Outcome]) -> dict[str, Any]:
    """Summary by method, rotation set, and kind of tasks: in all, and by translation.

    ``ratio`` is over all trials of a set, of which the far translations may have fewer than the
    near ones; ``mean_over_translations`` gives every translation the same weight.
    """
    names = list(dict.fromkeys(o.record.method for o in outcomes))
    methods = summarise_trials([o.record for o in outcomes], names)["methods"]
    for curve in curves(outcomes):
        sets = methods[curve.method].setdefault("sets", {})
        name = ",".join(f"{angle:g}" for angle in curve.rotation_deg)
        kind = "overlap" if curve.overlapping else "all"
        sets.setdefault(name, {})[kind] = _figures(curve.outcomes) | {
            "mean_over_translations": rounded(curve.mean_ratio, _DIGITS),
            "per_translation": [
                {"translation_m": distance, **_figures(group)}
                for distance, group in curve.points.items()
            ],
        }
    return {"least_overlap": LEAST_OVERLAP, "methods": methods}


def _figures(outcomes: Sequence[Outcome]) -> dict[str, Any]:
    counted = share(outcomes)
    low, high = counted.interval
    distances_m = [math.dist(_place(o.drawn.start), _place(o.drawn.goal)) for o in outcomes]
    return {
        "trials": counted.trials,
        "converged": counted.successes,
        "ratio": rounded(counted.ratio, _DIGITS),
        "interval_95": [rounded(low, _DIGITS), rounded(high, _DIGITS)],
        "mean_distance_m": rounded(mean(distances_m), _DIGITS),
        "mean_overlap": rounded(mean([o.drawn.overlap for o in outcomes]), _DIGITS),
    }


def _place(pose: tuple[float, ...]) -> tuple[float, float, float]:
    return pose[3], pose[7], pose[11]


def tidy_row(outcome: Outcome) -> dict[str, Any]:
    """One trial as a flat row."""
    drawn = outcome.drawn
    x, y, z = drawn.cell.rotation_deg
    return {
        "environment": drawn.environment,
        "translation_per_axis_m": drawn.cell.translation_m,
        "rotation_x_deg": x,
        "rotation_y_deg": y,
        "rotation_z_deg": z,
        "overlap": round(drawn.overlap, _DIGITS),
        "drawn_freely": drawn.freely,
        **row(outcome.record),
        "seed": outcome.seed,
    }


def summary_lines(outcomes: Sequence[Outcome]) -> list[str]:
    """Ratios in percent for people, a line for every curve; a dash where there is no task."""
    found = curves(outcomes)
    distances = sorted({d for curve in found for d in curve.points})
    head = f"{'method':<19} {'rotation':<10} {'tasks':<8} {'ratio':>6}  {'95 %':>8}  {'n':>4} "
    lines = [f"{head}{'even':>5} " + "".join(f"{d:>6g}" for d in distances) + " m per axis"]
    for curve in found:
        low, high = curve.share.interval
        points = {d: share(group) for d, group in curve.points.items()}
        cells = "".join(_percent(points.get(d)) for d in distances)
        rotation = ",".join(f"{a:g}" for a in curve.rotation_deg)
        kind = f">={LEAST_OVERLAP:.0%}" if curve.overlapping else "all"
        even = f"{curve.mean_ratio:>5.0%}" if curve.outcomes else f"{'-':>5}"
        lines.append(
            f"{curve.method:<19} {rotation:<10} {kind:<8} {_percent(curve.share)}"
            f"  {100 * low:3.0f}-{100 * high:3.0f} %  {curve.share.trials:>4}"
            f" {even} {cells}"
        )
    return lines


def _percent(counted: Share | None) -> str:
    return f"{'-':>6}" if counted is None or not counted.trials else f"{counted.ratio:>6.0%}"
