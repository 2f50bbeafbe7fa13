"""The option ``--version`` of every command line."""

from __future__ import annotations

import argparse
from importlib.metadata import version


def add_version(parser: argparse.ArgumentParser) -> None:
    """Add ``--version``: prints program and version of the distribution, exit code 0."""
    parser.add_argument(
        "--version",
        action="version",
        version=f"{parser.prog} {version('dfvs')}",
        help="print the version and exit",
    )
