"""Runs of flights by the command line: seed after seed, or several vehicles at a time."""

import argparse
import math
import sys
from pathlib import Path

from dfvs_common.lifecycle import EXIT_FAILED, EXIT_OK
from dfvs_core.errors import ConfigError
from dfvs_sim.demo.fleet import Member, fly_together
from dfvs_sim.demo.flight.flight import FLIGHT_ERRORS, Flight
from dfvs_sim.demo.flight.service_settings import settings_in_force
from dfvs_sim.demo.flight.track import Track
from dfvs_sim.demo.image_size import AUTO, SIZES, measured_size
from dfvs_sim.demo.options import FIRST_SYSTEM_ID, Conditions, FlightOptions, conditions_from
from dfvs_sim.demo.plan import FlightPlan, make_plan
from dfvs_sim.demo.progress import Progress
from dfvs_sim.demo.results.report import FlightReport, ReportError
from dfvs_sim.demo.results.summary import (
    NOT_READY,
    FlightSummary,
    flight_table,
    write_not_flown,
    write_results,
)
from dfvs_sim.options import camera_from, parse_camera_pose, renderer_from, write_json
from dfvs_sim.scene import two_rooms_path

DOORWAY_ROUTE = ("0,-2,-1.3,90", "0,-1,-1.3,77", "0.1,-0.15,-1.3,47", "0.2,0.7,-1.3,16")
"""Start and goals in the two rooms: eastwards through the doorway, then round to the north."""


def fly_fleet(args: argparse.Namespace, words: tuple[str, ...], progress: Progress) -> int:
    """Fly several vehicles at a time and print their table."""
    for name, is_given in (("--runs", args.runs > 1), ("--autopilot", args.autopilot is not None)):
        if is_given:
            raise ConfigError(
                f"{name} beside --vehicles",
                "only one of them",
                "dfvs-demo once for each, with --name, --system-id and --ground",
            )
    size = measured_size(progress.log, args.vehicles) if args.size == AUTO else args.size
    words = (*words, "--size", size, "--rate", str(args.rate))
    members = []
    for k in range(args.vehicles):
        folder = made_folder(_folder(args, args.seed) / f"vehicle-{k + 1}")
        system_id = (args.system_id or FIRST_SYSTEM_ID) + k
        members.append(Member(f"{args.name}-{k + 1}", system_id, args.seed + k, folder, words))
    codes = fly_together(members, progress.log)
    documents = [member.document() for member in members]
    print(flight_table(documents))
    if args.json is not None:
        write_json(args.json, documents)
    return EXIT_OK if not any(codes) else max(EXIT_FAILED, *codes)


def fly_seeds(args: argparse.Namespace, progress: Progress) -> int:
    """Fly one seed after the other; of several flights, one that cannot be flown ends no other.

    Raises
    ------
    DfvsError
        If a single flight cannot be brought up, or none of several ever could.
    """
    is_size_open = args.size == AUTO
    if is_size_open:
        args.size = SIZES[0][0]
    camera = camera_from(args)
    if args.route:
        _take_route(args)
    start = None if args.start is None else parse_camera_pose(args.start, "--start")
    goals = [parse_camera_pose(text, "--goal") for text in args.goal or ()]
    renderer = renderer_from(args)
    if is_size_open:
        make_plan(renderer, camera, args.seed, start, goals)  # what cannot be flown is said first
        args.size = measured_size(progress.log)
        camera = camera_from(args)
    summaries = []
    for seed in range(args.seed, args.seed + args.runs):
        plan = make_plan(renderer, camera, seed, start, goals)
        folder = _folder(args, seed)
        summaries.append(_fly_one(plan, args, folder, progress))
        _write_json(args, summaries)
    if args.runs > 1:
        print(flight_table([s.to_json() for s in summaries]))
    return EXIT_OK if all(s.converged for s in summaries) else EXIT_FAILED


def _take_route(args: argparse.Namespace) -> None:
    """Put the route through the doorway in place of what was not said."""
    if args.scene is not None or args.start is not None or args.goal is not None:
        raise ConfigError("--route beside --scene, --start or --goal", "only one of them")
    args.scene = two_rooms_path()
    args.start, *args.goal = DOORWAY_ROUTE


def _folder(args: argparse.Namespace, seed: int) -> Path:
    folder: Path = args.out or Path(f"demo-{seed}")
    if args.out is not None and args.runs > 1:
        folder = folder / f"seed-{seed}"
    return made_folder(folder)


def made_folder(folder: Path) -> Path:
    """Make a folder unless it is there; returns its absolute path."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise ConfigError(f"cannot make the folder {folder} ({error.strerror})") from error
    return folder.absolute()


def _fly_one(
    plan: FlightPlan, args: argparse.Namespace, folder: Path, progress: Progress
) -> FlightSummary:
    distance_m, angle_rad = plan.initial_error
    progress.log(
        f"seed {plan.seed}: {distance_m:.2f} m and {math.degrees(angle_rad):.1f} degrees "
        "from the goal"
    )
    service = args.service.split()
    report = None if args.no_report else FlightReport(folder, settings_in_force(service))
    options = FlightOptions(
        timeout_s=args.timeout,
        ready_s=args.ready,
        rate_hz=args.rate,
        vehicle=args.name,
        system_id=args.system_id,
        conditions=conditions_from(args) if args.autopilot is None else Conditions(),
        autopilot=args.autopilot,
        ground=args.ground,
        service=(*(report.words if report else ()), *service),
        camera=args.camera,
        dashboard=args.dashboard,
        pause=_pause if args.dashboard and sys.stdin.isatty() else lambda _: None,
    )
    flight = Flight(plan, options, folder, lambda text: progress.log(f"  {text}"))
    try:
        log = flight.run(progress.show)
    except FLIGHT_ERRORS as error:
        if args.runs == 1:
            raise
        progress.log(f"  {NOT_READY}: {error}")
        return write_not_flown(plan.seed, options, str(error), folder)
    summary = write_results(log, folder)
    verdict = "converged" if summary.converged else f"{summary.end_state}: {summary.end_cause}"
    progress.log(
        f"  {verdict}: {summary.final_translation_m * 100:.1f} cm and "
        f"{summary.final_rotation_deg:.2f} degrees after {summary.duration_s:.1f} s, path ratio "
        f"{summary.path_ratio:.2f}"
    )
    made = "" if report is None else f"{_made_report(report, log.track, progress)} and "
    progress.log(f"  {made}summary.json in {folder}")
    return summary


def _made_report(report: FlightReport, track: Track, progress: Progress) -> str:
    """Make the report; its files, or why there is none."""
    progress.log("  making the report")
    try:
        return ", ".join(path.name for path in report.make(track))
    except ReportError as error:
        return f"no report ({error})"


def _pause(what: str) -> None:
    """Give somebody at a terminal the time to look."""
    print(f"  {what} ", end="", file=sys.stderr, flush=True)
    sys.stdin.readline()


def _write_json(args: argparse.Namespace, summaries: list[FlightSummary]) -> None:
    """Write the summary: a mapping for one flight, a list for several."""
    if args.json is None:
        return
    documents = [s.to_json() for s in summaries]
    write_json(args.json, documents[0] if args.runs == 1 else documents)
