"""``dfvs-sim``: the simulated world, whole or in parts."""

import sys
from collections.abc import Sequence

from dfvs_common.command_line import program_parser, run_subcommand
from dfvs_common.lifecycle import cannot_run
from dfvs_sim.commands import camera, goal, pilot, vehicle, world

_EPILOG = """examples:
  dfvs-sim                                            vehicle and camera together
  dfvs-sim goal --pose 0.5,-1,-1.3,40 --out goal.png  a goal image with its sidecar
  dfvs-sim vehicle --record flight.jsonl              the vehicle alone
  dfvs-sim camera --mavlink udpin://127.0.0.1:14550   the camera alone, beside any PX4
  dfvs-sim pilot                                      fly it by words: arm, takeoff, offboard ...
"""

_MOVED = {
    **dict.fromkeys(("room", "pairs"), "dfvs-rooms"),
    **dict.fromkeys(("faults", "answers", "fuzz", "soak"), "dfvs-robustness"),
}


def main(argv: Sequence[str] | None = None) -> int:
    """Run one command; 0 when it worked, 2 when it cannot run, with one line that says why."""
    words = list(sys.argv[1:] if argv is None else argv)
    if words and words[0] in _MOVED:
        program = _MOVED[words[0]]
        return cannot_run(f"dfvs-sim has no command {words[0]!r}; use {program} {words[0]}")
    parser = program_parser(
        "dfvs-sim",
        "A simulated drone with PX4's MAVLink face, a camera that renders what it "
        "sees, and rooms to fly in.",
        _EPILOG,
    )
    subparsers = parser.add_subparsers(metavar="COMMAND")
    for command in (vehicle, camera, pilot, goal):
        command.add_parser(subparsers)
    parser.set_defaults(run=world.run)
    return run_subcommand(parser, words)


if __name__ == "__main__":
    sys.exit(main())
