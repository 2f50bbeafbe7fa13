"""``dfvs-bench``: measurements that compare."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence

from dfvs_sim.command_line import run_command
from dfvs_sim.commands import bench_flow

_EPILOG = """example:
  dfvs-bench flow pairs.npz --bundle classical --json flow.json
"""


def main(argv: Sequence[str] | None = None) -> int:
    """Run one measurement; 0 when it ran, 2 when it cannot, with one line that says why."""
    parser = argparse.ArgumentParser(
        prog="dfvs-bench",
        description="Measure correspondences on picture pairs with exact flow.",
        epilog=_EPILOG,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    subparsers = parser.add_subparsers(metavar="COMMAND", required=True)
    bench_flow.add_parser(subparsers)
    return run_command(parser, argv)


if __name__ == "__main__":
    sys.exit(main())
