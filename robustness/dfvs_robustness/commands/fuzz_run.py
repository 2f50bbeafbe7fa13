"""Command line of a fuzz target whose episodes are checked step by step."""

import argparse
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Generic, TypeVar

from dfvs_common.command_line import require_file, require_range
from dfvs_common.progress import log
from dfvs_core.errors import ConfigError
from dfvs_robustness.fuzz.run import Outcome, Tally, Target, run_episodes
from dfvs_sim.options import write_json

T = TypeVar("T", bound=Tally)
E = TypeVar("E")

_PROGRESS_S = 5.0


class ProgressLine:
    """Prints at most one line on standard error every few seconds, while a run goes on."""

    def __init__(self) -> None:
        self._next_s = 0.0

    def show(self, text: str) -> None:
        """Print the text if it is time to."""
        now_s = time.monotonic()
        if now_s >= self._next_s:
            self._next_s = now_s + _PROGRESS_S
            log(f"  {text}")


@dataclass(frozen=True, slots=True)
class FuzzCommand(Generic[T, E]):
    """A subcommand of ``dfvs-robustness fuzz``."""

    name: str
    help: str
    description: str
    example: str
    """Arguments that replay a file."""
    target: Target[T, E]
    items: str
    """Attribute of an episode with what it consists of."""
    figures: Callable[[T], dict[str, Any]]
    """Counts of a tally that only this target has, as JSON holds them."""
    text: Callable[[dict[str, Any]], str]
    """Lines for people from the report."""

    def add_parser(self, subparsers: Any) -> None:
        """Add the subcommand."""
        command = f"dfvs-robustness fuzz {self.name}"
        epilog = (
            f"examples:\n  {command} --events 10000000 --workers 2 --json {self.name}.json\n"
            f"  {command} --replay {self.example}\n\n"
            "exit code: 0 no violation, 1 an invariant was violated, 2 cannot run\n"
        )
        parser = subparsers.add_parser(
            self.name,
            help=self.help,
            description=self.description,
            epilog=epilog,
        )
        add = parser.add_argument
        add("--events", type=int, default=1_000_000, metavar="N", help="at least so many events")
        add("--workers", type=int, default=1, metavar="N", help="processes (default: 1)")
        add("--seed", type=int, default=0, help="of all that is random")
        add("--out", type=Path, default=Path(), metavar="DIR", help="folder for what violates")
        add("--replay", type=Path, metavar="FILE", help="replay one saved violation")
        add("--json", type=Path, metavar="FILE", help="write the figures there")
        parser.set_defaults(run=self.run)

    def run(self, args: argparse.Namespace) -> int:
        """Fuzz or replay; 0 without a violation, 1 with one."""
        if args.replay is not None:
            violation = self.target.replay(self.target.read(args.replay))
            print("no violation" if violation is None else f"violated: {violation}")
            return 0 if violation is None else 1
        require_range(args, 1, None, "events", "workers")
        require_range(args, 0, None, "seed")
        require_file("--json", args.json)
        if not args.out.is_dir():
            raise ConfigError(f"--out {args.out} is no folder", "an existing folder")
        began_s = time.monotonic()
        line = ProgressLine()

        def tell(so_far: Outcome[T, E]) -> None:
            events, found = so_far.tally.events, len(so_far.findings)
            line.show(f"{events:,} of {args.events:,} events, {found} violations")

        outcome = run_episodes(self.target, args.events, args.workers, args.seed, tell)
        report = self._report(outcome, args.seed, time.monotonic() - began_s)
        for number, finding in enumerate(outcome.findings):
            path = args.out / f"{self.name}-{finding.rule}-{number}.json"
            self.target.write(finding, path)
            print(f"{finding.rule} violated: {finding.text}")
            print(f"  {self._length(finding.episode)} {self.items}: {path}")
        print(f"{self.text(report)}\n{len(outcome.findings)} violations")
        if args.json is not None:
            write_json(args.json, report)
        return 1 if outcome.findings else 0

    def _report(self, outcome: Outcome[T, E], seed: int, wall_s: float) -> dict[str, Any]:
        tally = outcome.tally
        return {
            "seed": seed,
            "episodes": tally.episodes,
            "events": tally.events,
            "wall_s": round(wall_s, 1),
            "events_per_core_second": round(tally.events / max(outcome.busy_s, 1e-9)),
            **self.figures(tally),
            "violations": [
                {"rule": f.rule, "text": f.text, self.items: self._length(f.episode)}
                for f in outcome.findings
            ],
        }

    def _length(self, episode: E) -> int:
        return len(getattr(episode, self.items))
