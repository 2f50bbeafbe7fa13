"""Command lines of several commands: parsing, exit codes, one-line errors, ``--version``."""

from __future__ import annotations

import argparse
from collections.abc import Callable, Iterable, Sequence
from importlib.metadata import version
from typing import Any

from dfvs_common import lifecycle


def add_version(parser: argparse.ArgumentParser) -> None:
    """Add ``--version``: prints program and version of the distribution, exit code 0."""
    parser.add_argument(
        "--version",
        action="version",
        version=f"{parser.prog} {version('dfvs')}",
        help="print the version and exit",
    )


def run_program(
    argv: Sequence[str] | None, commands: Iterable[Callable[[Any], None]], **texts: str
) -> int:
    """Run one of the commands of a program; its exit code.

    ``texts`` are argparse's ``prog``, ``description`` and ``epilog``; each of the commands adds
    its parser to what ``ArgumentParser.add_subparsers`` gave.
    """
    formatter = argparse.RawDescriptionHelpFormatter
    parser = argparse.ArgumentParser(formatter_class=formatter, **texts)  # type: ignore[arg-type]
    add_version(parser)
    subparsers = parser.add_subparsers(metavar="COMMAND", required=True)
    for add_parser in commands:
        add_parser(subparsers)
    return run_subcommand(parser, argv)


def run_subcommand(parser: argparse.ArgumentParser, argv: Sequence[str] | None) -> int:
    """Parse, call the chosen command's ``run(args)``, and turn errors into exit codes."""
    args = parser.parse_args(argv)
    return lifecycle.run_command(lambda: _run(args))


def _run(args: argparse.Namespace) -> int:
    try:
        return int(args.run(args))
    except OSError as error:  # a full disk, a folder without rights
        where = f"{error.filename}: " if error.filename else ""
        return lifecycle.cannot_run(f"{where}{error.strerror or error}")
