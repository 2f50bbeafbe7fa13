"""How every command line of the simulator ends: an exit code, and one line where it cannot run."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable, Iterable, Sequence
from typing import Any

from dfvs_common import lifecycle
from dfvs_common.version import add_version

AddParser = Callable[[Any], None]
"""Adds a subcommand to what ``ArgumentParser.add_subparsers`` gave."""


def run_program(argv: Sequence[str] | None, commands: Iterable[AddParser], **texts: str) -> int:
    """Run one of the commands of a program; its exit code.

    ``texts`` are argparse's ``prog``, ``description`` and ``epilog``.
    """
    formatter = argparse.RawDescriptionHelpFormatter
    parser = argparse.ArgumentParser(formatter_class=formatter, **texts)  # type: ignore[arg-type]
    add_version(parser)
    subparsers = parser.add_subparsers(metavar="COMMAND", required=True)
    for add_parser in commands:
        add_parser(subparsers)
    return run_command(parser, argv)


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
