"""``dfvs-demo``: fly a simulated drone to a picture, and show how it went."""

import argparse
import contextlib
import sys
from collections.abc import Sequence
from pathlib import Path

from dfvs_common.command_line import program_parser, require_file, require_range
from dfvs_common.lifecycle import run_command
from dfvs_core.messages.topics import Topics
from dfvs_sim.demo.fleet import MOST_VEHICLES
from dfvs_sim.demo.flight.camera_link import CAMERAS
from dfvs_sim.demo.flight.engagement import engagement_of
from dfvs_sim.demo.image_size import AUTO, RATE_HZ, SHARED_RATE_HZ, SIZE_HELP, is_shared
from dfvs_sim.demo.options import (
    VEHICLE_NAME,
    add_autopilot_options,
    add_condition_options,
    check_autopilot,
    conditions_from,
)
from dfvs_sim.demo.progress import Progress
from dfvs_sim.demo.runs import fly_fleet, fly_seeds
from dfvs_sim.options import add_camera_options, add_scene_option

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
    with contextlib.closing(Progress()) as progress:
        _check(args)
        if args.vehicles > 1:
            return fly_fleet(args, words, progress)
        return fly_seeds(args, progress)


def _parser() -> argparse.ArgumentParser:
    parser = program_parser(
        "dfvs-demo",
        "Bring up a simulated drone, its camera, a stand-in pilot and the real "
        "dfvs-service, and fly to a goal image. Nothing but this machine is needed.",
        _EPILOG,
    )
    add_scene_option(parser)
    add_camera_options(parser, AUTO, SIZE_HELP)
    add = parser.add_argument
    add("--seed", type=int, default=0, help="draws start and goal, and the noise")
    add("--runs", type=int, default=1, metavar="N", help="fly N seeds, one after the other")
    add("--vehicles", type=int, default=1, metavar="N", help="fly N seeds at a time, 1 to 4")
    add(
        "--name", default=VEHICLE_NAME, help="vehicle name in the Zenoh keys (default: %(default)s)"
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
    add_autopilot_options(parser)
    add("--service", default="", metavar="WORDS", help="further words for dfvs-service")
    add("--out", type=Path, metavar="DIR", help="folder for the results (default: demo-SEED)")
    add("--json", type=Path, metavar="FILE", help="write the summary there as well")
    add("--no-report", action="store_true", help="fly only: no recording, no page, no film")
    return parser


def _check(args: argparse.Namespace) -> None:
    """Refuse what cannot be flown, and settle what other options decide."""
    require_range(args, 1, MOST_VEHICLES, "vehicles")
    require_range(args, 1, 251 - args.vehicles, "system_id")  # of the first vehicle
    require_range(args, 1, None, "runs", "timeout", "ready")
    require_range(args, 0, None, "seed")
    Topics(args.name)
    if args.rate is None:
        args.rate = SHARED_RATE_HZ if is_shared(args.vehicles) else RATE_HZ
    require_range(args, 0.1, 240, "rate")
    require_file("--json", args.json)
    check_autopilot(args)
    conditions_from(args)
    link = () if args.autopilot is None else ("--mavlink", args.autopilot)
    engagement_of((*link, *args.service.split()))


if __name__ == "__main__":
    sys.exit(main())
