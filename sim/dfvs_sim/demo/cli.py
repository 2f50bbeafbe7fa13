"""``dfvs-demo``: fly a simulated drone to a picture, and show how it went."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path

from dfvs_common.lifecycle import run_command
from dfvs_common.version import add_version
from dfvs_core.errors import ConfigError
from dfvs_sim.demo.conditions import (
    Conditions,
    add_condition_options,
    conditions_from,
    refuse_conditions,
)
from dfvs_sim.demo.fleet import Member, check_vehicles, fly_together
from dfvs_sim.demo.flight.camera_link import CAMERAS
from dfvs_sim.demo.flight.engagement import engagement_of
from dfvs_sim.demo.flight.flight import Flight
from dfvs_sim.demo.flight.track import Track
from dfvs_sim.demo.image_size import (
    AUTO,
    RATE_HZ,
    SHARED_RATE_HZ,
    SIZE_HELP,
    SIZES,
    as_text,
    is_shared,
    measured_size,
)
from dfvs_sim.demo.options import FIRST_SYSTEM_ID, VEHICLE_NAME, FlightOptions
from dfvs_sim.demo.plan import FlightPlan, make_plan
from dfvs_sim.demo.progress import Progress
from dfvs_sim.demo.results.files import replace_json, write_results
from dfvs_sim.demo.results.report import FlightReport, ReportError
from dfvs_sim.demo.results.summary import FlightSummary
from dfvs_sim.demo.results.table import flight_table
from dfvs_sim.options import (
    add_camera_options,
    add_scene_option,
    camera_from,
    parse_camera_pose,
    require_folder,
)
from dfvs_sim.render.renderer import Renderer
from dfvs_sim.scene import builtin_room_path, two_rooms_path
from dfvs_sim.scene.glb import load_glb

DOORWAY_ROUTE = ("0,-2,-1.3,90", "0,-1,-1.3,77", "0.1,-0.15,-1.3,47", "0.2,0.7,-1.3,16")
"""Start and goals in the two rooms: eastwards through the doorway, then round to the north."""


EXIT_OK, EXIT_NOT_REACHED = 0, 1
_EPILOG = """examples:
  dfvs-demo                                     one flight in the built-in room
  dfvs-demo --runs 10 --json seeds.json         ten flights, seeds 0 to 9
  dfvs-demo --scene my_room.glb --seed 3        in a room of your own
  dfvs-demo --dashboard                         watched in a browser
  dfvs-demo --start 0,0,-1.3,0 --goal 0.8,0.4,-1.2,20
  dfvs-demo --route                             three goals, through a doorway
  dfvs-demo --vehicles 2                        two vehicles at a time
  dfvs-demo --autopilot udpin://127.0.0.1:14540 with a PX4 SITL that runs already
"""


def main(argv: Sequence[str] | None = None) -> int:
    """Fly; 0 if every flight converged, 1 if one did not, 2 if it cannot run."""
    words = tuple(sys.argv[1:] if argv is None else argv)
    args = _parser().parse_args(words)
    return run_command(lambda: _run(args, words))


def _run(args: argparse.Namespace, words: tuple[str, ...]) -> int:
    progress = Progress()
    try:
        _check(args)
        if args.vehicles > 1:
            return _fly_fleet(args, words, progress)
        return _fly_all(args, progress)
    finally:
        progress.close()


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="dfvs-demo",
        description="Bring up a simulated drone, its camera, a stand-in pilot and the real "
        "dfvs-service, and fly to a goal image. Nothing but this machine is needed.",
        epilog=_EPILOG,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    add_version(parser)
    add_scene_option(parser)
    add_camera_options(parser, AUTO, SIZE_HELP)
    add = parser.add_argument
    add("--seed", type=int, default=0, help="draws start and goal, and the noise")
    add("--runs", type=int, default=1, metavar="N", help="fly N seeds, one after the other")
    add("--vehicles", type=int, default=1, metavar="N", help="fly N seeds at a time, 1 to 4")
    add(
        "--name", default=VEHICLE_NAME, help="vehicle name in the Zenoh keys (default: %(default)s)"
    )
    add(
        "--system-id",
        type=int,
        metavar="N",
        help="MAVLink system id (default: 1, or that of the vehicle on --autopilot's link)",
    )
    add_condition_options(parser)
    add("--start", metavar="X,Y,Z,YAW", help="start of the camera: NED in the scene, m, degrees")
    add(
        "--goal",
        nargs="+",
        metavar="X,Y,Z,YAW",
        help="goal of the camera, likewise; several are flown to one after the other",
    )
    add(
        "--route",
        action="store_true",
        help="fly through a doorway by three goals; the last one is out of sight at the start",
    )
    add(
        "--rate",
        type=float,
        metavar="HZ",
        help=f"frames a second (default: {RATE_HZ:g}, or {SHARED_RATE_HZ:g} of each of several "
        "vehicles that share too few cores)",
    )
    add("--timeout", type=float, default=90.0, metavar="S", help="give up a flight after so long")
    add("--ready", type=float, default=40.0, metavar="S", help="wait so long for the service")
    add(
        "--camera",
        choices=CAMERAS,
        default=CAMERAS[0],
        help="how frames travel: our own format, or ROS 2 messages as rmw_zenoh (Image) or "
        "zenoh-bridge-ros2dds (CompressedImage) sends them",
    )
    add("--dashboard", action="store_true", help="watch the flight in a browser")
    add("--autopilot", metavar="URL", help="MAVLink of a running autopilot, not the stand-in")
    add("--ground", metavar="URL", help="its ground-station link (default udpin on 14550)")
    add("--service", default="", metavar="WORDS", help="further words for dfvs-service")
    add("--out", type=Path, metavar="DIR", help="folder for the results (default: demo-SEED)")
    add("--json", type=Path, metavar="FILE", help="write the summary there as well")
    add("--no-report", action="store_true", help="fly only: no recording, no page, no film")
    return parser


def _check(args: argparse.Namespace) -> None:
    """Refuse what cannot be flown, and settle what other options decide."""
    check_vehicles(args.vehicles)
    if args.runs < 1:
        raise ConfigError(f"--runs is {args.runs}", "1 or more")
    if args.system_id is not None and not 1 <= args.system_id <= 250:
        raise ConfigError(f"--system-id is {args.system_id}", "1 to 250")
    if args.rate is None:
        args.rate = SHARED_RATE_HZ if is_shared(args.vehicles) else RATE_HZ
    if not 0.1 <= args.rate <= 240:
        raise ConfigError(f"--rate is {args.rate:g}", "0.1 to 240 frames a second")
    if args.ground is not None and args.autopilot is None:
        raise ConfigError("--ground without --autopilot", "the links of a running autopilot")
    require_folder("--json", args.json)
    if args.autopilot is not None:
        refuse_conditions(args, "--autopilot")
    conditions_from(args)
    engagement_of(args.service.split())


def _fly_fleet(args: argparse.Namespace, words: tuple[str, ...], progress: Progress) -> int:
    """Fly several vehicles at a time and print their table."""
    for name, is_given in (("--runs", args.runs > 1), ("--autopilot", args.autopilot is not None)):
        if is_given:
            raise ConfigError(
                f"{name} beside --vehicles",
                "only one of them",
                "dfvs-demo once for each, with --name, --system-id and --ground",
            )
    size = measured_size(progress.say, args.vehicles) if args.size == AUTO else args.size
    words = (*words, "--size", size, "--rate", str(args.rate))
    members = []
    for k in range(args.vehicles):
        folder = _made(_folder(args, args.seed) / f"vehicle-{k + 1}")
        system_id = (args.system_id or FIRST_SYSTEM_ID) + k
        members.append(Member(f"{args.name}-{k + 1}", system_id, args.seed + k, folder, words))
    codes = fly_together(members, progress.say)
    documents = [member.document() for member in members]
    print(flight_table(documents))
    if args.json is not None:
        replace_json(args.json, documents)
    return EXIT_OK if not any(codes) else max(EXIT_NOT_REACHED, *codes)


def _fly_all(args: argparse.Namespace, progress: Progress) -> int:
    """Fly one seed after the other."""
    is_size_open = args.size == AUTO
    if is_size_open:
        args.size = as_text(SIZES[0][0])
    camera = camera_from(args)
    if args.route:
        _take_route(args)
    start = None if args.start is None else parse_camera_pose(args.start, "--start")
    goals = [parse_camera_pose(text, "--goal") for text in args.goal or ()]
    renderer = Renderer(load_glb(args.scene or builtin_room_path()))
    if is_size_open:
        make_plan(renderer, camera, args.seed, start, goals)  # what cannot be flown is said first
        args.size = measured_size(progress.say)
        camera = camera_from(args)
    summaries = []
    for seed in range(args.seed, args.seed + args.runs):
        plan = make_plan(renderer, camera, seed, start, goals)
        folder = _folder(args, seed)
        summaries.append(_fly_one(plan, args, folder, progress))
        _write_json(args, summaries)
    if args.runs > 1:
        print(flight_table([s.to_json() for s in summaries]))
    return EXIT_OK if all(s.converged for s in summaries) else EXIT_NOT_REACHED


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
    return _made(folder)


def _made(folder: Path) -> Path:
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise ConfigError(f"cannot make the folder {folder} ({error.strerror})") from error
    return folder.absolute()


def _fly_one(
    plan: FlightPlan, args: argparse.Namespace, folder: Path, progress: Progress
) -> FlightSummary:
    distance_m, angle_rad = plan.initial_error
    progress.say(
        f"seed {plan.seed}: {distance_m:.2f} m and {angle_rad * 57.29578:.1f} degrees from the goal"
    )
    report = None if args.no_report else FlightReport(folder, tuple(args.service.split()))
    options = FlightOptions(
        timeout_s=args.timeout,
        ready_s=args.ready,
        rate_hz=args.rate,
        vehicle=args.name,
        system_id=args.system_id,
        conditions=conditions_from(args) if args.autopilot is None else Conditions(),
        autopilot=args.autopilot,
        ground=args.ground,
        service=(*(report.words if report else ()), *args.service.split()),
        camera=args.camera,
        dashboard=args.dashboard,
        pause=_pause if args.dashboard and sys.stdin.isatty() else lambda _: None,
    )
    log = Flight(plan, options, folder, lambda text: progress.say(f"  {text}")).run(progress.show)
    summary = write_results(log, folder)
    verdict = "converged" if summary.converged else f"{summary.end_state}: {summary.end_cause}"
    progress.say(
        f"  {verdict}: {summary.final_translation_m * 100:.1f} cm and "
        f"{summary.final_rotation_deg:.2f} degrees after {summary.duration_s:.1f} s, path ratio "
        f"{summary.path_ratio:.2f}"
    )
    made = "" if report is None else f"{_made_report(report, log.track, progress)} and "
    progress.say(f"  {made}summary.json in {folder}")
    return summary


def _made_report(report: FlightReport, track: Track, progress: Progress) -> str:
    """Make the report; its files, or why there is none."""
    progress.say("  making the report")
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
    replace_json(args.json, documents[0] if args.runs == 1 else documents)


if __name__ == "__main__":
    sys.exit(main())
