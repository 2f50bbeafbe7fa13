"""How every command line of the simulator ends: an exit code, and one line where it cannot run."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence

from dfvs_common import lifecycle


def run_command(parser: argparse.ArgumentParser, argv: Sequence[str] | None) -> int:
    """Parse, call the chosen command's ``run(args)``, and turn errors into exit codes."""
    args = parser.parse_args(argv)
    return lifecycle.run_command(lambda: _run(args))


def _run(args: argparse.Namespace) -> int:
    try:
        return int(args.run(args))
    except OSError as error:  # a full disk, a folder without rights
        where = f"{error.filename}: " if error.filename else ""
        print(f"error: {where}{error.strerror or error}", file=sys.stderr)
        return lifecycle.EXIT_CANNOT_RUN
