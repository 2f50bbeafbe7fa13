"""``dfvs-bench lockstep``: many flights in simulated time, faster than real time."""

import argparse
import math
from dataclasses import replace
from pathlib import Path
from typing import Any

from dfvs_bench.lockstep.calibration import plot_calibration
from dfvs_bench.lockstep.flight import EXACT, SimulatedJob
from dfvs_bench.lockstep.record import SimulatedFlight, summarise
from dfvs_bench.lockstep.run import fly
from dfvs_bench.report.figures import figure_format
from dfvs_bench.trials.executor import TrialExecutor
from dfvs_bench.trials.provenance import made_with
from dfvs_common.command_line import require_file
from dfvs_common.progress import log
from dfvs_core.errors import ConfigError
from dfvs_core.gate.limits import VelocityLimits
from dfvs_core.messages.goal import Mount
from dfvs_core.messages.schema import dump
from dfvs_models import DEFAULT_DEPTH
from dfvs_models.catalog import load_depth
from dfvs_sim.commands import vehicle
from dfvs_sim.demo.options import add_condition_options, conditions_from
from dfvs_sim.options import add_scene_option, parse_seeds, write_json
from dfvs_sim.scene import builtin_room_path

_LIMITS = VelocityLimits()
_DEPTHS = ("motion", "network", "fused", "flow", "constant")
_SETTINGS = (
    *("matcher", "depth", "depth_bundle", "mounted_deg", "upside_down"),
    *("speed", "slew", "hold", "timeout"),
)
"""Options that the file of --json repeats, beside scene and conditions."""
_EPILOG = """examples:
  dfvs-bench lockstep --seeds 1000-1199 --workers 2 --json flights.json --plot calibration.png
  dfvs-bench lockstep --seeds 1000-1019 --estimate high --mounted-deg 180
  dfvs-bench lockstep --seeds 1000-1099 --depth fused
  dfvs-bench lockstep --seeds 1000-1009 --matcher dfvs-flow --hold 120

Vehicle, camera, perception and gate run in one process, in steps of simulated time; the gate and
perception are those of dfvs-service. The matcher 'exact' takes the correspondences from the
renderer's depth, with noise; any other one sees rendered images. A depth network sees the goal
image.

The error of the distance is that of frames after 1 m of path (distance_from_m) and 10 cm or more
from the goal: distance_frames of them, in distance_flights flights. A shorter flight gives none.
"""


def add_parser(subparsers: Any) -> None:
    """Add ``lockstep`` to the subcommands of ``dfvs-bench``."""
    parser = subparsers.add_parser(
        "lockstep",
        help="many flights in simulated time",
        description="Fly seeds in simulated time: ends and false alarms, how well the goal is "
        "held, and the distance estimate against the truth and against its stated uncertainty.",
        epilog=_EPILOG,
    )
    add_scene_option(parser)
    add = parser.add_argument
    add("--seeds", default="0-9", metavar="A-B", help="seeds of start, goal and errors")
    add("--matcher", default=EXACT, metavar="NAME", help="exact, or a matcher of dfvs-service")
    add("--depth", default="motion", choices=_DEPTHS, help="servo.depth (default: motion)")
    add("--depth-bundle", default=DEFAULT_DEPTH, metavar="NAME", help="the depth network's bundle")
    add(
        "--mounted-deg",
        type=float,
        default=0.0,
        metavar="DEG",
        help="turn of the camera's mounting about the vertical",
    )
    add("--upside-down", action="store_true", help="turn it by 180 degrees about its line of sight")
    add("--speed", type=float, default=_LIMITS.horizontal_m_s, metavar="M_S", help="speed limit")
    add("--slew", type=float, default=_LIMITS.slew_m_s2, metavar="M_S2", help="limit of its change")
    add("--hold", type=float, default=5.0, metavar="S", help="hold the goal by vision so long")
    add("--timeout", type=float, default=60.0, metavar="S", help="give up a flight after so long")
    add("--workers", type=int, default=1, metavar="N", help="processes")
    add_condition_options(parser)
    add("--json", type=Path, metavar="FILE", help="write settings, summary and flights")
    add("--plot", type=Path, metavar="FILE", help="draw the calibration of the distance")
    parser.set_defaults(run=run)


def run(args: argparse.Namespace) -> int:
    """Fly, print a line a flight and the summary; exit code 0."""
    _check_outputs(args)
    jobs = _jobs(args)
    flights: list[SimulatedFlight] = []
    for flight in TrialExecutor(args.workers).finished(fly, jobs):
        flights.append(flight)
        log(f"{_line(flight)}  ({len(flights)} of {len(jobs)})")
    flights.sort(key=lambda f: f.seed)
    summary = summarise(flights)
    for name, value in summary.items():
        print(f"{name:<24} {_text(value)}")
    if args.json is not None:
        names = [n for n in SimulatedFlight.__slots__ if not n.startswith("distance_")]
        rows = [{name: getattr(flight, name) for name in names} for flight in flights]
        settings = {name: getattr(args, name) for name in _SETTINGS}
        settings |= {"scene": str(jobs[0].scene)} | dump(conditions_from(args))
        facts = {"made_with": made_with(), "settings": settings}
        write_json(args.json, facts | {"summary": summary, "flights": rows})
    if args.plot is not None:
        plot_calibration(flights, args.plot)
    return 0


def _check_outputs(args: argparse.Namespace) -> None:
    """Refuse files that could not be written after the flights."""
    require_file("--json", args.json)
    require_file("--plot", args.plot)
    if args.plot is not None:
        figure_format("--plot", args.plot)


def _jobs(args: argparse.Namespace) -> list[SimulatedJob]:
    seeds = parse_seeds(args.seeds, "--seeds", "a number, or two as in 0-9")
    for name, most in (("hold", 3600.0), ("timeout", 3600.0), ("speed", 5.0), ("slew", 5.0)):
        if not 0 < getattr(args, name) <= most:
            raise ConfigError(f"--{name} is {getattr(args, name):g}", f"above 0, to {most:g}")
    limits = replace(_LIMITS, horizontal_m_s=args.speed, slew_m_s2=args.slew)
    load_depth(args.depth, args.depth_bundle, 1)  # refuses at once what cannot be used
    conditions = conditions_from(args)
    parser = argparse.ArgumentParser()
    vehicle.add_options(parser)
    config = vehicle.config_from_args(parser.parse_args(conditions.words)).vehicle
    roll_rad = math.pi if args.upside_down else 0.0
    mounted = Mount(roll_rad=roll_rad, yaw_rad=math.radians(args.mounted_deg))
    return [
        SimulatedJob(
            seed=seed,
            scene=args.scene or builtin_room_path(),
            vehicle=config,
            matcher=args.matcher,
            timeout_s=args.timeout,
            hold_s=args.hold,
            mounted=mounted,
            limits=limits,
            depth=args.depth,
            depth_model=args.depth_bundle,
        )
        for seed in seeds
    ]


def _line(flight: SimulatedFlight) -> str:
    start = "not released to servo" if flight.start_m is None else f"{flight.start_m:.2f} m"
    end = "" if flight.end_s is None else f" after {flight.end_s:.1f} s"
    held = "" if flight.hold_rms_m is None else f", held to {100 * flight.hold_rms_m:.1f} cm rms"
    cause = f" ({flight.end_cause})" if flight.end_cause and flight.end_state != "DONE" else ""
    return f"seed {flight.seed}: {start}, {flight.end_state}{end}{held}{cause}"


def _text(value: object) -> str:
    if isinstance(value, float):
        return f"{value:.3f}"
    return "-" if value is None else str(value)
