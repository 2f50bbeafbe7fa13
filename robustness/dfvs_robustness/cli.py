"""``dfvs-robustness``: the fault matrix, fuzzing, soak runs and answer times."""

import sys
from collections.abc import Sequence

from dfvs_common.command_line import program_parser, run_subcommand
from dfvs_robustness.commands import answers, faults, fuzz, soak

_EPILOG = """examples:
  dfvs-robustness faults --seeds 1 --workers 2         disturb the real service, and judge it
  dfvs-robustness fuzz gate --events 1000000           random inputs for the gate
  dfvs-robustness soak --minutes 60                    one long flight, and its memory
"""


def main(argv: Sequence[str] | None = None) -> int:
    """Run one command; 0 when it worked, 2 when it cannot run, with one line that says why."""
    parser = program_parser(
        "dfvs-robustness",
        "Disturb the service on purpose, and judge it by the safety invariants.",
        _EPILOG,
    )
    subparsers = parser.add_subparsers(metavar="COMMAND", required=True)
    for command in (faults, answers, fuzz, soak):
        command.add_parser(subparsers)
    return run_subcommand(parser, argv)


if __name__ == "__main__":
    sys.exit(main())
