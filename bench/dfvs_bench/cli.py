"""``dfvs-bench``: measurements that compare."""

import sys
from collections.abc import Sequence

from dfvs_bench.commands import (
    basin,
    controller,
    depth,
    drone,
    flow,
    lockstep,
    relocalise,
    renderer,
    report,
    scenes,
    table1,
)
from dfvs_common.command_line import program_parser, run_subcommand

_EPILOG = """examples:
  dfvs-bench flow pairs.npz --bundle classical --json flow.json
  dfvs-bench table1 --methods true-depth,motion-depth --json table1.json
  dfvs-bench basin --workers 2 --plot basin.png
  dfvs-bench drone --json drone.json
"""


def main(argv: Sequence[str] | None = None) -> int:
    """Run one measurement; 0 when it ran, 2 when it cannot, with one line that says why."""
    parser = program_parser(
        "dfvs-bench",
        "Measure correspondences on image pairs, and servoing methods in scenes.",
        _EPILOG,
    )
    subparsers = parser.add_subparsers(metavar="COMMAND", required=True)
    measurements = (flow, depth, scenes, table1, controller, basin, drone, lockstep, renderer)
    for command in (*measurements, relocalise, report):
        command.add_parser(subparsers)
    return run_subcommand(parser, argv)


if __name__ == "__main__":
    sys.exit(main())
