"""Options of a demo flight: how to fly, what it meets, and another autopilot."""

import argparse
from collections.abc import Callable
from dataclasses import dataclass, field

from dfvs_common.command_line import require_range
from dfvs_core.errors import ConfigError
from dfvs_sim.dynamics.estimate_errors import EstimateGrade
from dfvs_sim.options import grade_names, parse_estimate, parse_wind

VEHICLE_NAME = "demo"
FIRST_SYSTEM_ID = 1
"""Of the simulated vehicle, as of a PX4 SITL."""
USUAL_ESTIMATE = EstimateGrade.MEDIUM.value
"""As of a drone between optical flow and satellites alone."""


@dataclass(frozen=True, slots=True)
class Conditions:
    """Grade of the state estimate and wind, as ``dfvs-sim vehicle`` takes them.

    Raises
    ------
    ConfigError
        If there is no such grade or wind.
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


@dataclass(frozen=True, slots=True)
class FlightOptions:
    """How to fly."""

    timeout_s: float = 90.0
    ready_s: float = 40.0
    """How long the service may take to be ready; ``timeout_s`` is of the flight."""
    rate_hz: float = 15.0
    """Frames a second."""
    camera_nice: int = 0
    """How far the simulated camera gives way to the service."""
    vehicle: str = VEHICLE_NAME
    """Name of the vehicle in the Zenoh keys."""
    system_id: int | None = None
    """MAVLink system id; None takes 1 for the simulated vehicle, and the id on the companion's link
    for another one.
    """
    autopilot: str | None = None
    """MAVLink URL of a vehicle that runs already; None starts the simulated one."""
    ground: str | None = None
    """URL of that vehicle's ground-station link."""
    conditions: Conditions = field(default_factory=Conditions)
    service: tuple[str, ...] = ()
    """Further words for ``dfvs-service``."""
    camera: str = "dfvs"
    """How frames travel (see ``CAMERAS``)."""
    dashboard: bool = False
    """Serve a page to watch the flight in a browser."""
    pause: Callable[[str], None] = lambda _: None
    """Called before and after a flight with what the user may do."""

    @property
    def is_simulated(self) -> bool:
        """Whether the flight brings its own simulated vehicle."""
        return self.autopilot is None

    @property
    def estimate(self) -> str | None:
        """Grade of the state estimate; None beside another autopilot, where it is unknown."""
        return self.conditions.estimate if self.is_simulated else None

    @property
    def wind(self) -> str | None:
        """Wind, likewise."""
        return self.conditions.wind if self.is_simulated else None


def add_condition_options(parser: argparse.ArgumentParser) -> None:
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

    Raises
    ------
    ConfigError
        If there is no such grade or wind.
    """
    return Conditions(args.estimate or USUAL_ESTIMATE, args.wind or Conditions().wind)


def add_autopilot_options(parser: argparse.ArgumentParser) -> None:
    """Add ``--autopilot``, ``--ground`` and ``--system-id``."""
    add = parser.add_argument
    add("--autopilot", metavar="URL", help="MAVLink of a running simulated PX4; it is armed")
    add("--ground", metavar="URL", help="its ground-station link (default udpin on 14550)")
    add(
        "--system-id",
        type=int,
        metavar="N",
        help="MAVLink system id (default: 1, or that of the vehicle on --autopilot's link)",
    )


def check_autopilot(args: argparse.Namespace) -> None:
    """Refuse these options, and those that only the simulated vehicle has, if they do not agree."""
    require_range(args, 1, 250, "system_id")
    if args.ground is not None and args.autopilot is None:
        raise ConfigError("--ground without --autopilot", "the links of a running autopilot")
    for name in ("autopilot", "ground"):
        url = getattr(args, name)
        if url is not None and "://" not in url:
            raise ConfigError(f"--{name} is {url!r}", "a MAVLink URL such as udpin://HOST:PORT")
    for name in ("estimate", "wind"):
        if args.autopilot is not None and getattr(args, name) is not None:
            raise ConfigError(f"--{name} beside --autopilot", "only one of them")
