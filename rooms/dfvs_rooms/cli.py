"""``dfvs-rooms``: furnished rooms, and pairs of views in them."""

import sys
from collections.abc import Sequence

from dfvs_common.command_line import program_parser, run_subcommand
from dfvs_rooms.commands import pairs, room

_EPILOG = """examples:
  dfvs-rooms room --kind hall --seed 5 --light quick --out hall.glb
  dfvs-rooms pairs --rooms 8000-8019 --count 45 --seed 1 --out pairs.npz
"""


def main(argv: Sequence[str] | None = None) -> int:
    """Run one command; 0 when it worked, 2 when it cannot run, with one line that says why."""
    parser = program_parser(
        "dfvs-rooms",
        "Generate furnished rooms from seeds, bake their light, and render pairs of "
        "views with exact flow.",
        _EPILOG,
    )
    subparsers = parser.add_subparsers(metavar="COMMAND", required=True)
    for command in (room, pairs):
        command.add_parser(subparsers)
    return run_subcommand(parser, argv)


if __name__ == "__main__":
    sys.exit(main())
