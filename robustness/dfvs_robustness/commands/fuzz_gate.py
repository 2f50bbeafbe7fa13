"""``dfvs-robustness fuzz gate``: random inputs, and the invariants after every step."""

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
from dfvs_robustness.fuzz.gate_fuzz import GATE, Finding, Tally, replay_episode
from dfvs_robustness.fuzz.replay import read_episode, write_finding
from dfvs_robustness.fuzz.run import Outcome

_EPILOG = """examples:
  dfvs-robustness fuzz gate --events 10000000 --workers 2 --json gate.json
  dfvs-robustness fuzz gate --replay gate-I4-0.json

exit code: 0 no violation, 1 an invariant was violated, 2 cannot run
"""


def add_parser(subparsers: Any) -> None:
    """Add ``gate`` to the subcommands of ``dfvs-robustness fuzz``."""
    parser = subparsers.add_parser(
        "gate",
        help="random inputs for the gate's state machine",
        description="Let the gate live through random flights: perception, vehicle, pilot, "
        "operator and clock behave, then go wrong. After every step the invariants I1 to I9 are "
        "checked by a second, independent judgement of all that the gate was told. A violation "
        "is shrunk to the few steps that it needs and saved.",
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
    outcome, wall_s = run_campaign(GATE, args)
    report = figures(outcome, args.seed, wall_s)
    save_findings(outcome, args, "gate", _write)
    print(_summary(report))
    return end_run(outcome, args, report)


def _write(finding: Finding, path: Path) -> str:
    write_finding(finding, path)
    return f"{len(finding.episode.steps)} steps"


def figures(outcome: Outcome[Tally, Finding], seed: int, wall_s: float) -> dict[str, Any]:
    """What is written as JSON."""
    tally = outcome.tally
    return {
        "seed": seed,
        "lives": tally.episodes,
        "steps": tally.steps,
        "events": tally.events,
        "steps_that_move": tally.moving,
        "lives_lived_twice": tally.twins,
        "wall_s": round(wall_s, 1),
        "events_per_core_second": round(tally.events / max(outcome.busy_s, 1e-9)),
        "events_by_kind": dict(tally.kinds.most_common()),
        "steps_by_state": dict(tally.states.most_common()),
        "transitions": dict(tally.transitions.most_common()),
        "causes": dict(tally.causes.most_common()),
        "violations": [
            {"rule": f.rule, "text": f.text, "steps": len(f.episode.steps)}
            for f in outcome.findings
        ],
    }


def _summary(report: dict[str, Any]) -> str:
    states = ", ".join(f"{name} {steps:,}" for name, steps in report["steps_by_state"].items())
    return (
        f"{report['events']:,} events in {report['steps']:,} steps of {report['lives']:,} lives, "
        f"{report['wall_s']:.0f} s, {report['events_per_core_second']:,} events a core and second\n"
        f"steps by state: {states}\n"
        f"{len(report['transitions'])} kinds of transition, {len(report['causes'])} causes\n"
        f"{len(report['violations'])} violations"
    )
