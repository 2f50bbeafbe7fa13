"""``dfvs-robustness soak``: goal after goal, and what it does to the service's processes."""

import argparse
import time
from dataclasses import asdict
from pathlib import Path
from typing import Any

from dfvs_common.command_line import require_file, require_range
from dfvs_core.errors import ConfigError
from dfvs_robustness.soak.mission import Mission, MissionOptions
from dfvs_robustness.soak.verdict import MAX_MB_PER_H, judge, latency_figures
from dfvs_sim.demo.flight.engagement import engagement_of
from dfvs_sim.demo.flight.flight import FlightError
from dfvs_sim.demo.image_size import AUTO, SIZE_HELP, measured_size
from dfvs_sim.demo.plan import make_plan
from dfvs_sim.demo.progress import Progress
from dfvs_sim.demo.runs import made_folder
from dfvs_sim.options import (
    add_camera_options,
    add_scene_option,
    camera_from,
    renderer_from,
    write_json,
)

_EPILOG = """example:
  dfvs-robustness soak --minutes 30 --json soak.json --out soak

exit code: 0 nothing grows, 1 something grows or the time was too short to tell, 2 cannot run
"""


def add_parser(subparsers: Any) -> None:
    """Add ``soak`` to the subcommands of ``dfvs-robustness``."""
    parser = subparsers.add_parser(
        "soak",
        help="fly goal after goal and watch memory, descriptors and threads",
        description="Fly the real dfvs-service from goal to goal by signed commands, with the same "
        "processes all the time, and judge whether their memory, file descriptors or threads grow.",
        epilog=_EPILOG,
    )
    add_scene_option(parser)
    add_camera_options(parser, AUTO, SIZE_HELP)
    add = parser.add_argument
    add("--minutes", type=float, default=30.0, metavar="N", help="time to fly (default: 30)")
    add("--seed", type=int, default=0, help="draws the places to fly between")
    add("--rate", type=float, default=15.0, metavar="HZ", help="frames a second (default: 15)")
    add("--service", default="", metavar="WORDS", help="further words for dfvs-service")
    add("--out", type=Path, default=Path("soak"), metavar="DIR", help="folder for logs and plots")
    add("--json", type=Path, metavar="FILE", help="write the figures there as well")
    parser.set_defaults(run=run)


def run(args: argparse.Namespace) -> int:
    """Fly and judge; 0 if nothing grows, else 1."""
    require_range(args, 1, 6000, "minutes")
    require_range(args, 1, 60, "rate")
    require_range(args, 0, None, "seed")
    require_file("--json", args.json)
    words = tuple(args.service.split())
    engagement_of(words)
    folder = made_folder(args.out)
    progress = Progress()
    if args.size == AUTO:
        args.size = measured_size(progress.log)
    renderer = renderer_from(args)
    plan = make_plan(renderer, camera_from(args), args.seed, None, [])
    options = MissionOptions(folder, args.minutes, args.rate, words)
    mission = Mission(plan, options, lambda text: progress.log(f"  {text}"))
    began_s, ended = time.monotonic(), ""
    try:
        mission.run(lambda watch, track: None)
    except FlightError as error:
        ended = str(error)
        if not mission.legs:
            raise
    report = figures(mission, (time.monotonic() - began_s) / 60.0, ended)
    _print(report)
    write_json(args.out / "soak.json", report)
    if args.json is not None:
        write_json(args.json, report)
    return 0 if report["verdict"] == "passed" else 1


def figures(mission: Mission, minutes: float, ended: str) -> dict[str, Any]:
    """What is written as JSON; plots go beside it.

    Raises
    ------
    ConfigError
        If there are too few samples to tell anything.
    """
    samples = [] if mission.sampler is None else mission.sampler.samples
    try:
        verdicts = judge(samples)
    except ValueError as error:
        raise ConfigError(f"too short a flight to judge ({error})", "more --minutes") from error
    from dfvs_robustness.soak.plots import write_plots  # matplotlib takes a second to import

    write_plots(samples, mission.folder / "soak.png")
    is_held = any(hold.is_false for hold in mission.holds)
    reached = sum(leg.state == "DONE" for leg in mission.legs)
    all_well = all(v.passed for v in verdicts) and not is_held and reached == len(mission.legs)
    return {
        "minutes": round(minutes, 2),
        "legs": len(mission.legs),
        "reached": reached,
        "holds": [asdict(hold) | {"false": hold.is_false} for hold in mission.holds],
        "ended_early": ended,
        "limit_mb_per_h": MAX_MB_PER_H,
        "processes": [asdict(v) | {"passed": v.passed} for v in verdicts],
        "latency_ms": latency_figures(samples),
        "verdict": "passed" if all_well and not ended else "failed",
        "flown": [asdict(leg) for leg in mission.legs],
    }


def _print(report: dict[str, Any]) -> None:
    names = f"{'own MB':>10s}{'MB/h':>9s}{'95 % interval':>19s}{'fds':>5s}{'threads':>9s}"
    print(f"{'process':14s}{names}")
    for p in report["processes"]:
        interval = f"{p['mb_per_h_low']:.2f} to {p['mb_per_h_high']:.2f}"
        print(
            f"{p['role']:14s}{p['last_own_mb']:10.1f}{p['mb_per_h']:9.2f}{interval:>19s}"
            f"{p['descriptors_grown']:+5d}{p['threads_grown']:+9d}  memory {p['memory']}"
        )
    print(
        f"{report['legs']} legs in {report['minutes']:.1f} min, {report['reached']} reached, "
        f"{len(report['holds'])} holds, {sum(h['false'] for h in report['holds'])} of them false: "
        f"{report['verdict']}"
    )
    for hold in report["holds"]:
        print(
            f"  {hold['cause']}: no image for {hold['camera_gap_ms']:.0f} ms, none seen for "
            f"{hold['seen_gap_ms']:.0f}, at most {hold['latency_ms']:.0f} to its report"
        )
