"""What a simulated flight meets: errors of the state estimate, and wind."""

import argparse
from dataclasses import dataclass
from typing import Any

from dfvs_sim.dynamics.estimate_errors import EstimateGrade
from dfvs_sim.options import grade_names, parse_estimate, parse_wind

USUAL_ESTIMATE = EstimateGrade.MEDIUM.value
"""As of a drone between optical flow and satellites alone."""


@dataclass(frozen=True, slots=True)
class Conditions:
    """Grade of the state estimate and wind, as ``dfvs-sim vehicle`` takes them.

    Raises ConfigError if there is no such grade or wind.
    """

    estimate: str = EstimateGrade.PERFECT.value
    wind: str = "calm"

    def __post_init__(self) -> None:
        parse_estimate(self.estimate)
        parse_wind(self.wind)

    @property
    def words(self) -> tuple[str, ...]:
        """Words for ``dfvs-sim vehicle``."""
        return f"--estimate={self.estimate}", f"--wind={self.wind}"


def add_condition_options(parser: Any) -> None:
    """Add ``--estimate`` and ``--wind``."""
    grades = grade_names(EstimateGrade)
    parser.add_argument(
        "--estimate",
        metavar="GRADE",
        help=f"errors of the simulated state estimate: {grades} (default: {USUAL_ESTIMATE})",
    )
    parser.add_argument(
        "--wind",
        metavar="GRADE|N,E",
        help="wind on the simulated vehicle, as dfvs-sim vehicle takes it (default: calm)",
    )


def conditions_from(args: argparse.Namespace) -> Conditions:
    """Conditions of ``--estimate`` and ``--wind``.

    Raises ConfigError if there is no such grade or wind.
    """
    return Conditions(args.estimate or USUAL_ESTIMATE, args.wind or Conditions().wind)
