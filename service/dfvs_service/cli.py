"""``dfvs-service``: fly to a goal image, command a flight, print the settings."""

import argparse
import io
import os
import sys
from collections.abc import Iterable, Sequence
from pathlib import Path

from dfvs_common.atomic_file import write_atomic
from dfvs_common.command_line import (
    program_parser,
    require_options,
    require_range,
    require_replaceable,
)
from dfvs_common.lifecycle import EXIT_FAILED, EXIT_OK, run_command
from dfvs_common.progress import warn
from dfvs_core.errors import ConfigError, DfvsError
from dfvs_core.gate.config import Engage, OnDone
from dfvs_core.gate.events import Action
from dfvs_core.geometry.arrays import ImageArray
from dfvs_core.messages.image import encode_png
from dfvs_service.flight_setup import (
    check_camera,
    check_commands,
    check_ports,
    display_of,
    programs_of,
    resolve_route,
    runtime_folder,
    with_flights_folder,
    with_model,
)
from dfvs_service.flights.cli import flights
from dfvs_service.replay.gate import replay_gate
from dfvs_service.route.cli import run as teach
from dfvs_service.settings.config import ServiceConfig
from dfvs_service.settings.config_text import markdown_table, toml_text
from dfvs_service.settings.exposure import exposure_checks
from dfvs_service.settings.goal_file import goal_command, read_image, read_sidecar, route_images
from dfvs_service.settings.key_file import create_key, load_key
from dfvs_service.settings.options import add_settings_options, settings_from
from dfvs_service.supervisor.console import shows_colours
from dfvs_service.supervisor.parent import fly, prepare_runtime

_CHECK_S = 15.0
"""Time for which the checks may take to pass, unless told otherwise."""

_EXAMPLE = """\
example, beside a running PX4 and a camera that publishes on dfvs/drone1/camera:
  dfvs-service --goal goal.png --config service.toml

the same without a flight, as a table of ticks and crosses:
  dfvs-service --goal goal.png --config service.toml --check

other commands:
  dfvs-service config                             print all settings as commented TOML
  dfvs-service command new-key --key-file my.key  make a key for signed commands
  dfvs-service command engage --key-file my.key   engage, hold or abort a running service
  dfvs-service command goal --goal b.png --key-file my.key   give it another goal
  dfvs-service teach --out route/                 record a route of goals from a flight by hand
  dfvs-service flights                            list, show or export what flights left behind
  dfvs-service replay-gate gate-inputs.jsonl      decide a recorded flight again

exit code: 0 the goal was reached (or every check passed), 1 the flight ended otherwise (or a check
failed), 2 cannot run
"""


def main(argv: Sequence[str] | None = None) -> int:
    """Entry point; returns the exit code."""
    words = list(sys.argv[1:] if argv is None else argv)
    commands = {
        "config": _print_config,
        "command": _command,
        "flights": flights,
        "replay-gate": replay_gate,
        "teach": teach,
    }
    chosen = commands.get(words[0]) if words else None
    if chosen is not None:
        return run_command(lambda: chosen(words[1:]))
    return run_command(lambda: _fly(words, commands))


# --- settings ---------------------------------------------------------------------------------


def _print_config(words: Sequence[str]) -> int:
    parser = argparse.ArgumentParser(
        prog="dfvs-service config",
        description="Print the settings of a flight with these options as commented TOML, ready to "
        "be edited. Options that are no settings change nothing.",
        epilog="example: dfvs-service config --engage auto > service.toml",
    )
    _add_flight_options(parser)
    parser.add_argument("--markdown", action="store_true", help="print a table for documentation")
    arguments = parser.parse_args(words)
    as_text = markdown_table if arguments.markdown else toml_text
    print(as_text(_flight_settings(arguments)), end="")
    return EXIT_OK


# --- commands ---------------------------------------------------------------------------------


def _command(words: Sequence[str]) -> int:
    parser = argparse.ArgumentParser(
        prog="dfvs-service command",
        description="Send a signed command to a running service, or make a key for that.",
        epilog="example: dfvs-service command hold --key-file my.key --vehicle drone1",
    )
    parser.add_argument("command", choices=["new-key", *(str(action) for action in Action)])
    parser.add_argument("--key-file", type=Path, required=True, metavar="FILE")
    parser.add_argument("--goal", type=Path, metavar="IMAGE", help="the new goal, for 'goal'")
    parser.add_argument("--timeout", type=float, default=3.0, metavar="S", help="(default: 3)")
    add_settings_options(parser)
    arguments = parser.parse_args(words)
    if arguments.command == "new-key":
        create_key(arguments.key_file)
        print(f"wrote {arguments.key_file}; give it to the service as gate.command_key_file")
        return EXIT_OK
    # Zenoh is needed here alone, and takes its time to load.
    from dfvs_service.command import send_command

    require_range(arguments, 0.1, 600, "timeout")
    config = settings_from(arguments)
    action, goal_path = Action(arguments.command), arguments.goal
    if (action is Action.GOAL) != (goal_path is not None):
        raise ConfigError(
            f"command {arguments.command!r} {'without' if goal_path is None else 'with'} --goal",
            "--goal IMAGE with the command 'goal', and with no other",
        )
    goal = None if goal_path is None else goal_command(goal_path)
    answer = send_command(config, load_key(arguments.key_file), action, arguments.timeout, goal)
    print(answer)
    return EXIT_OK if answer.startswith("accepted") else EXIT_FAILED


# --- flight -----------------------------------------------------------------------------------


def _renamed_image(path: str) -> Path:
    raise argparse.ArgumentTypeError(f"--picture is called --image: --image {path}")


def _add_flight_options(parser: argparse.ArgumentParser, *, needs_goal: bool = False) -> None:
    parser.add_argument(
        "--goal",
        type=Path,
        action="extend",
        nargs="+",
        required=needs_goal,
        metavar="IMAGE",
        help="PNG or JPEG; several, or a folder of them, are flown to one after the other",
    )
    add_settings_options(parser)
    parser.add_argument(
        "--engage",
        choices=[str(way) for way in Engage],
        help="who engages: the pilot's switch to OFFBOARD (default), the service, or a command",
    )
    parser.add_argument("--mavlink", metavar="URL", help="connection (vehicle.mavlink)")
    parser.add_argument(
        "--model", metavar="NAME", help="'classical', a bundle's name or its folder (flow.model)"
    )
    parser.add_argument(
        "--camera-fov", type=float, metavar="DEG", help="horizontal field of view of the camera"
    )
    parser.add_argument(
        "--on-done", choices=[str(way) for way in OnDone], help="at the goal (default: hold-visual)"
    )
    parser.add_argument(
        "--exit-when-done", action="store_true", default=None, help="end when the flight is over"
    )
    parser.add_argument(
        "--record", type=Path, metavar="DIR", help="record the flight as MCAP (record.folder)"
    )
    parser.add_argument(
        "--check",
        action="store_true",
        help="check everything against the goal and end; nothing is armed, moved or streamed",
    )
    parser.add_argument(
        "--check-timeout",
        type=float,
        metavar="S",
        help=f"wait so long for checks to pass (default: {_CHECK_S:g})",
    )
    parser.add_argument("--json", action="store_true", help="print the result of --check as JSON")
    parser.add_argument(
        "--image",
        type=Path,
        metavar="FILE.png",
        help="with --check: draw goal, frame, flow and the command that would follow",
    )
    parser.add_argument("--picture", type=_renamed_image, help=argparse.SUPPRESS)
    parser.add_argument(
        "--runtime-dir", type=Path, metavar="DIR", help="keep sockets and logs here"
    )
    parser.add_argument(
        "--json-log", action="store_true", help="print the gate's log as JSON lines"
    )


def _flight_settings(arguments: argparse.Namespace) -> ServiceConfig:
    """Settings with the options of a flight over them."""
    return settings_from(
        arguments,
        {
            "gate.engage": arguments.engage,
            "gate.on_done": arguments.on_done,
            "gate.exit_when_done": arguments.exit_when_done,
            "vehicle.mavlink": arguments.mavlink,
            "flow.model": arguments.model,
            "camera.horizontal_fov_deg": arguments.camera_fov,
            "record.folder": None if arguments.record is None else str(arguments.record.absolute()),
        },
    )


def _check_options(arguments: argparse.Namespace) -> None:
    """Refuse options of the check without it, and an image that could not be written."""
    require_range(arguments, 0.1, 3600, "check_timeout")
    for option, is_given in (
        ("--image", arguments.image is not None),
        ("--json", arguments.json),
        ("--check-timeout", arguments.check_timeout is not None),
    ):
        if is_given and not arguments.check:
            raise ConfigError(f"{option} without --check", "both, or neither")
    if arguments.image is not None:
        require_replaceable("--image", arguments.image, ".png")


def _fly(words: Sequence[str], commands: Iterable[str]) -> int:
    require_options(words, commands)
    parser = program_parser(
        "dfvs-service", "Fly a PX4 drone to the view that a goal image shows.", _EXAMPLE
    )
    _add_flight_options(parser, needs_goal=True)
    arguments = parser.parse_args(words)
    config = _flight_settings(arguments)
    _check_options(arguments)
    goal_paths = route_images(arguments.goal)
    if arguments.check:
        return _check(config, goal_paths, arguments)
    config, route = resolve_route(with_flights_folder(config), goal_paths)
    for goal_path, each in route:
        check_camera(config, goal_path, each)
    goal, *later = (each for _, each in route)
    check_commands(config)
    check_ports(config)
    config = with_model(config, goal)
    for check in exposure_checks(config):
        if not check.ok:
            warn(f"{check.detail} ({check.remedy})")
    with runtime_folder(arguments.runtime_dir) as runtime:
        check_ports(config)  # the model took seconds to load
        prepare_runtime(runtime, config, goal, later)
        return fly(runtime, programs_of(config), display_of(runtime, as_json=arguments.json_log))


def _check(config: ServiceConfig, goal_paths: Sequence[Path], arguments: argparse.Namespace) -> int:
    """Print a table of what is right and what is not; nothing is armed, moved or streamed."""
    # ONNX Runtime is needed here, and takes its time to load.
    from dfvs_service.preflight.check import check_camera_and_model, check_everything

    # A goal that cannot be read is no cross, but nothing to check by.
    for goal_path in goal_paths:
        read_image(goal_path)
        read_sidecar(goal_path)
    drawn: list[ImageArray] = []
    try:
        config, route = resolve_route(config, goal_paths)
    except DfvsError as error:
        report = check_camera_and_model(config, error)
    else:
        check_ports(config)
        with runtime_folder(arguments.runtime_dir) as runtime:
            show = None if arguments.image is None else drawn.append
            timeout_s = _CHECK_S if arguments.check_timeout is None else arguments.check_timeout
            report = check_everything(config, route, runtime, timeout_s, show=show)
    if drawn:
        write_atomic(arguments.image, encode_png(drawn[0]))
    elif arguments.image is not None:
        warn("no image, since nothing was seen: correct what fails")
    if isinstance(sys.stdout, io.TextIOWrapper):
        sys.stdout.reconfigure(errors="namereplace")  # not every encoding has the marks
    colours = shows_colours(sys.stdout, os.environ)
    print(report.to_json() if arguments.json else report.to_text(colours=colours))
    return EXIT_OK if report.ok else EXIT_FAILED


if __name__ == "__main__":
    sys.exit(main())
