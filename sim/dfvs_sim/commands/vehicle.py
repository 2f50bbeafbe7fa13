"""``dfvs-sim vehicle``: the simulated quadrotor alone."""

import argparse
import math
from pathlib import Path
from typing import Any

from dfvs_common.command_line import require_range
from dfvs_common.lifecycle import stop_event
from dfvs_common.progress import log
from dfvs_core.errors import ConfigError
from dfvs_sim.dynamics.estimate_errors import EstimateGrade
from dfvs_sim.dynamics.wind import WindGrade
from dfvs_sim.options import grade_names, parse_estimate, parse_numbers, parse_wind
from dfvs_sim.vehicle.messages.udp_link import UdpPorts
from dfvs_sim.vehicle.motion.flight import VehicleConfig
from dfvs_sim.vehicle.process import ProcessConfig, run_vehicle

_EPILOG = """example:
  dfvs-sim vehicle --start 0,0,0,30 --record vehicle.jsonl
"""

_MOST_GROUND_M = 1000.0
_REPLACED = ("--velocity-noise", "--position-drift")
"""Options that ``--estimate`` replaces."""


def add_parser(subparsers: Any) -> None:
    """Add ``vehicle`` to the subcommands of ``dfvs-sim``."""
    parser = subparsers.add_parser(
        "vehicle",
        help="the simulated quadrotor with PX4's MAVLink face",
        description="A simulated quadrotor that answers on MAVLink as PX4 does. A companion "
        "listens on UDP 14540, a ground station on UDP 14550.",
        epilog=_EPILOG,
    )
    add_options(parser)
    parser.set_defaults(run=run)


def add_options(parser: argparse.ArgumentParser) -> None:
    """Add the vehicle's options to a parser."""
    add = parser.add_argument
    add("--companion-port", type=int, default=14540, help="UDP port of the companion's side")
    add("--companion-local-port", type=int, default=14580, help="our own side of it; 0: any")
    add("--gcs-port", type=int, default=14550, help="UDP port of the ground station's side")
    add("--gcs-local-port", type=int, default=18570, help="our own side of it; 0: any")
    add("--record", type=Path, metavar="FILE", help="write every setpoint, command and pose")
    add(
        "--start",
        default="0,0,0,0",
        metavar="X,Y,Z,YAW",
        help="where the local origin lies in the scene (NED, m), for the poses of --record, and "
        "the vehicle's heading at the start (degrees); the view begins there with "
        "dfvs-sim camera --origin X,Y,Z,0",
    )
    add("--ground-z", type=float, default=0.08, help="local z when standing on the ground, m")
    add("--ready-after", type=float, default=1.0, metavar="S", help="seconds until armable")
    add("--seed", type=int, default=0, help="seed of noise and delays")
    add("--system-id", type=int, default=1, metavar="N", help="MAVLink system id, 1 to 250")
    add(
        "--wind",
        default="calm",
        metavar="GRADE|N,E",
        help=f"{grade_names(WindGrade)}: wind with gusts, its direction drawn from the seed; or a "
        "steady wind towards north and east, m/s (default: %(default)s)",
    )
    add(
        "--estimate",
        default="perfect",
        metavar="GRADE",
        help=f"errors of the state estimate: {grade_names(EstimateGrade)} (default: %(default)s)",
    )
    for old in _REPLACED:
        add(old, help=argparse.SUPPRESS)


def run(args: argparse.Namespace) -> int:
    """Fly until interrupted; exit code 0."""
    config = config_from_args(args)
    stop = stop_event()
    log(
        f"vehicle: companion link to UDP {config.companion.remote}, "
        f"ground station link to UDP {config.ground.remote}"
    )
    run_vehicle(config, stop.is_set)
    return 0


def config_from_args(args: argparse.Namespace) -> ProcessConfig:
    """Options to configuration.

    Raises
    ------
    ConfigError
        If a list of numbers or a grade cannot be read, or a number is out of range.
    """
    for old in _REPLACED:
        if getattr(args, old.removeprefix("--").replace("-", "_"), None) is not None:
            raise ConfigError(f"{old} is not an option", f"--estimate {grade_names(EstimateGrade)}")
    x, y, z, yaw_deg = parse_numbers(args.start, "--start", 4)
    wind, (north, east) = parse_wind(args.wind)
    require_range(args, 1, 250, "system_id")
    require_range(args, 1, 65535, "companion_port", "gcs_port")
    require_range(args, 0, 65535, "companion_local_port", "gcs_local_port")
    require_range(args, 0, None, "seed", "ready_after")
    require_range(args, -_MOST_GROUND_M, _MOST_GROUND_M, "ground_z")
    return ProcessConfig(
        companion=UdpPorts(args.companion_local_port, args.companion_port),
        ground=UdpPorts(args.gcs_local_port, args.gcs_port),
        record=args.record,
        start_m=(x, y, z),
        seed=args.seed,
        vehicle=VehicleConfig(
            yaw_rad=math.radians(yaw_deg),
            ground_m=args.ground_z,
            ready_after_s=args.ready_after,
            system_id=args.system_id,
            estimate=parse_estimate(args.estimate),
            wind=wind,
            wind_north_m_s=north,
            wind_east_m_s=east,
        ),
    )
