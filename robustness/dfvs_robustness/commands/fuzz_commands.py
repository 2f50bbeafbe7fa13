"""``dfvs-robustness fuzz commands``: hostile commands through admission and authority."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

from dfvs_robustness.commands.fuzz_run import (
    add_options,
    end_run,
    print_replay,
    run_campaign,
    save_findings,
)
from dfvs_robustness.fuzz.command_fuzz import COMMANDS, CommandFinding, CommandTally, replay_episode
from dfvs_robustness.fuzz.command_replay import read_episode, write_finding
from dfvs_robustness.fuzz.run import Outcome

_EPILOG = """examples:
  dfvs-robustness fuzz commands --events 10000000 --workers 2 --json commands.json
  dfvs-robustness fuzz commands --replay commands-once-0.json

exit code: 0 no violation, 1 an invariant was violated, 2 cannot run
"""


def add_parser(subparsers: Any) -> None:
    """Add ``commands`` to the subcommands of ``dfvs-robustness fuzz``."""
    parser = subparsers.add_parser(
        "commands",
        help="hostile commands for the operator link and the gate",
        description="Send fresh, repeated, replayed, delayed, expired, forged, foreign and broken "
        "commands and goals through the operator link's admission to the gate's authority. What "
        "is obeyed must be signed, fresh and new; the same bytes must get the same answer; rate "
        "and memory must stay bounded. A violation is shrunk to the few sendings that it needs "
        "and saved.",
        epilog=_EPILOG,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    add_options(parser)
    parser.set_defaults(run=run)


def run(args: argparse.Namespace) -> int:
    """Fuzz or replay; 0 without a violation, 1 with one.

    Raises
    ------
    DfvsError
        If an option cannot be used.
    """
    if args.replay is not None:
        return print_replay(replay_episode(read_episode(args.replay)))
    outcome, wall_s = run_campaign(COMMANDS, args)
    report = figures(outcome, args.seed, wall_s)
    save_findings(outcome, args, "commands", _write)
    _print(report)
    return end_run(outcome, args, report)


def _write(finding: CommandFinding, path: Path) -> str:
    write_finding(finding, path)
    return f"{len(finding.episode.sendings)} sendings"


def figures(
    outcome: Outcome[CommandTally, CommandFinding], seed: int, wall_s: float
) -> dict[str, Any]:
    """What is written as JSON."""
    tally = outcome.tally
    return {
        "seed": seed,
        "lives": tally.episodes,
        "events": tally.events,
        "wall_s": round(wall_s, 1),
        "events_per_core_second": round(tally.events / max(outcome.busy_s, 1e-9)),
        "outcomes": dict(sorted(tally.outcomes.items())),
        "violations": [
            {"rule": f.rule, "text": f.text, "sendings": len(f.episode.sendings)}
            for f in outcome.findings
        ],
    }


def _print(report: dict[str, Any]) -> None:
    for name, count in report["outcomes"].items():
        print(f"{name:36s}{count:12,}")
    print(
        f"{report['events']:,} sendings in {report['lives']:,} lives, {report['wall_s']:.0f} s, "
        f"{report['events_per_core_second']:,} a core and second\n"
        f"{len(report['violations'])} violations"
    )
