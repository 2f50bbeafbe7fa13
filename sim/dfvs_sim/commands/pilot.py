"""``dfvs-sim pilot``: the pilot of a vehicle, by words."""

import argparse
import sys
from collections.abc import Callable, Iterable, Sequence
from typing import Any

from dfvs_common.command_line import require_range
from dfvs_common.progress import log
from dfvs_core.errors import ConfigError, DfvsError
from dfvs_sim.ground.link import GroundLink
from dfvs_sim.ground.pilot import LEAST_HEIGHT_M, MOST_HEIGHT_M, USUAL_HEIGHT_M, Pilot
from dfvs_sim.ground.sharing import DEFAULT_PORT
from dfvs_sim.vehicle.modes import Mode

_WORDS = {
    "arm": "arm; the vehicle disarms itself after 10 s without a take-off",
    "takeoff [M]": f"arm if need be, and climb so high (default: {USUAL_HEIGHT_M})",
    "offboard": "hand the vehicle to dfvs-service, which has to be READY",
    "hold": "take it back: Hold mode, at any time",
    "land": "land, and wait until the vehicle has disarmed itself",
    "status": "mode, and whether it is armed and flies",
}
_QUIT = ("quit", "exit")
_PROMPT = "pilot> "
_VEHICLE_S = 15.0

_DESCRIPTION = """The pilot of a vehicle: one word on the command line, or a prompt that takes
one word a line. Each word waits until the vehicle has done it. The ground-station port is
the camera's, which shares it: dfvs-sim does, and dfvs-sim camera --share 14551.

words:
"""
_EPILOG = """examples:
  dfvs-sim pilot takeoff 1.3
  dfvs-sim pilot offboard
  dfvs-sim pilot hold         in another terminal as well, while a word waits
"""


def add_parser(subparsers: Any) -> None:
    """Add ``pilot`` to the subcommands of ``dfvs-sim``."""
    words = "\n".join(f"  {word:<12} {meaning}" for word, meaning in _WORDS.items())
    parser = subparsers.add_parser(
        "pilot",
        help="fly a vehicle by words: arm, takeoff, offboard, hold, land",
        description=_DESCRIPTION + words,
        epilog=_EPILOG,
    )
    add = parser.add_argument
    add("words", nargs="*", metavar="WORD", help="what to do (default: ask at a prompt)")
    add(
        "--mavlink",
        default=f"udpout://127.0.0.1:{DEFAULT_PORT}",
        metavar="URL",
        help="ground-station link (default: %(default)s, the one that the camera shares)",
    )
    add("--system-id", type=int, metavar="N", help="MAVLink system id of the vehicle")
    parser.set_defaults(run=run)


def run(args: argparse.Namespace) -> int:
    """Do what the words say; exit code 0 when the vehicle did it."""
    require_range(args, 1, 250, "system_id")
    if args.words:
        parse(args.words)  # an error in the words comes before the wait for a vehicle
    with GroundLink(args.mavlink, args.system_id) as link:
        pilot = Pilot(link, log=print)
        log(f"pilot: waiting for a vehicle on {args.mavlink}")
        link.wait_for_vehicle(_VEHICLE_S)
        if args.words:
            execute(pilot, args.words)
        else:
            print(f"words: {', '.join(_WORDS)}, quit", flush=True)
            execute_lines(pilot, sys.stdin, is_prompted=sys.stdin.isatty())
    return 0


def parse(words: Sequence[str]) -> Callable[[Pilot], None]:
    """Action of a word with what belongs to it.

    Raises
    ------
    ConfigError
        If there is no such word, or if it takes no number or another one.
    """
    name, *rest = words
    actions: dict[str, Callable[[Pilot], None]] = {
        "arm": _arm,
        "offboard": lambda pilot: pilot.set_mode(Mode.OFFBOARD),
        "hold": lambda pilot: pilot.set_mode(Mode.HOLD),
        "land": lambda pilot: pilot.land(),
        "status": lambda _: None,
    }
    if name == "takeoff" and len(rest) < 2:
        height_m = _height(rest[0]) if rest else USUAL_HEIGHT_M
        return lambda pilot: _take_off(pilot, height_m)
    if name not in actions or rest:
        raise ConfigError(f"{' '.join(words)!r} is no word of the pilot", ", ".join(_WORDS))
    return actions[name]


def execute(pilot: Pilot, words: Sequence[str]) -> None:
    """Do what one line of words says, and print what has become of the vehicle.

    Raises
    ------
    DfvsError
        If the words are not known, or if the vehicle did not do it.
    """
    parse(words)(pilot)
    mode = pilot.mode()
    armed, flying = pilot.armed(), pilot.is_flying()
    print(
        f"{words[0]}: {mode.name if mode else 'mode unknown'}, "
        f"{'armed' if armed else 'disarmed'}, {'in the air' if flying else 'on the ground'}",
        flush=True,
    )


def execute_lines(pilot: Pilot, lines: Iterable[str], *, is_prompted: bool) -> None:
    """Do what each line says, until the last one or ``quit``.

    At a prompt an error is printed and the next line is asked for.

    Raises
    ------
    DfvsError
        Where nobody is asked, at the first error: what follows would be done in another state.
    """
    if is_prompted:
        print(_PROMPT, end="", flush=True)
    for line in lines:
        words = line.split()
        if words and words[0] in _QUIT:
            return
        try:
            if words:
                execute(pilot, words)
        except DfvsError as error:
            if not is_prompted:
                raise
            print(f"error: {error}", flush=True)
        if is_prompted:
            print(_PROMPT, end="", flush=True)


def _arm(pilot: Pilot) -> None:
    pilot.prepare()
    pilot.arm()


def _take_off(pilot: Pilot, height_m: float) -> None:
    pilot.prepare()
    pilot.take_off(height_m)


def _height(text: str) -> float:
    try:
        height_m = float(text)
    except ValueError:
        height_m = 0.0
    if not LEAST_HEIGHT_M <= height_m <= MOST_HEIGHT_M:
        raise ConfigError(
            f"the height to take off to is {text!r}", f"{LEAST_HEIGHT_M:g} to {MOST_HEIGHT_M:g} m"
        )
    return height_m
