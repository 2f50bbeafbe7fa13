"""Options, run and replay that the fuzz targets share."""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any, Protocol, TypeVar

from dfvs_core.errors import ConfigError
from dfvs_robustness.fuzz.progress import ProgressLine
from dfvs_robustness.fuzz.run import Outcome, Tally, Target, run_episodes
from dfvs_sim.options import write_json

T = TypeVar("T", bound=Tally)
F = TypeVar("F", bound="_Finding")


class _Finding(Protocol):
    """What a target found."""

    @property
    def rule(self) -> str:
        """Invariant that was violated."""

    @property
    def text(self) -> str:
        """How."""


def add_options(parser: argparse.ArgumentParser) -> None:
    """Add the options of a run."""
    add = parser.add_argument
    add("--events", type=int, default=1_000_000, metavar="N", help="at least so many events")
    add("--workers", type=int, default=1, metavar="N", help="processes (default: 1)")
    add("--seed", type=int, default=0, help="of all that is random")
    add("--out", type=Path, default=Path(), metavar="DIR", help="folder for what violates")
    add("--replay", type=Path, metavar="FILE", help="replay one saved violation")
    add("--json", type=Path, metavar="FILE", help="write the figures there")


def run_campaign(target: Target[T, F], args: argparse.Namespace) -> tuple[Outcome[T, F], float]:
    """Outcome of a run, and its duration in s.

    Raises
    ------
    ConfigError
        If an option cannot be used.
    """
    for option, value in (("events", args.events), ("workers", args.workers)):
        if value < 1:
            raise ConfigError(f"--{option} is {value}", "1 or more")
    if args.seed < 0:
        raise ConfigError(f"--seed is {args.seed}", "0 or more")
    if not args.out.is_dir():
        raise ConfigError(f"--out {args.out} is no folder", "an existing folder")
    began_s = time.monotonic()
    line = ProgressLine()

    def tell(so_far: Outcome[T, F]) -> None:
        events, found = so_far.tally.events, len(so_far.findings)
        line.show(f"{events:,} of {args.events:,} events, {found} violations")

    outcome = run_episodes(target, args.events, args.workers, args.seed, tell)
    return outcome, time.monotonic() - began_s


def save_findings(
    outcome: Outcome[T, F], args: argparse.Namespace, name: str, write: Callable[[F, Path], str]
) -> None:
    """Write and print the findings; ``write`` saves one and gives its length in words."""
    for number, finding in enumerate(outcome.findings):
        path = args.out / f"{name}-{finding.rule}-{number}.json"
        length = write(finding, path)
        print(f"{finding.rule} violated: {finding.text}\n  {length}: {path}")


def end_run(outcome: Outcome[T, F], args: argparse.Namespace, report: dict[str, Any]) -> int:
    """Write the figures where asked for; the exit code."""
    if args.json is not None:
        write_json(args.json, report)
    return 1 if outcome.findings else 0


def print_replay(violation: Exception | None) -> int:
    """Print what a saved episode violated; the exit code."""
    print("no violation" if violation is None else f"violated: {violation}")
    return 0 if violation is None else 1
