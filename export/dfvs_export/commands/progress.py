"""Telling what goes on."""

from __future__ import annotations

import sys


def say(line: str) -> None:
    """Report progress, apart from results."""
    print(line, file=sys.stderr, flush=True)
