"""``dfvs-robustness answers``: how fast commands are answered, and how often the state comes."""

import argparse
import dataclasses
import tempfile
from pathlib import Path
from typing import Any

from dfvs_common.command_line import require_file, require_range
from dfvs_common.lifecycle import EXIT_FAILED, EXIT_OK
from dfvs_common.progress import log
from dfvs_core.gate.states import GateState
from dfvs_robustness.answers.measurement import Try, run_answers
from dfvs_robustness.answers.report import markdown_lines
from dfvs_robustness.harness.load import take_precedence
from dfvs_sim.options import write_json

_EPILOG = """examples:
  dfvs-robustness answers                                  10 tries in every state
  dfvs-robustness answers --tries 207 --seconds 60 --json answers.json
  dfvs-robustness faults --minutes 0 --keep runs.jsonl --html faults.html --answers answers.json
                                                    the table in the report of the fault matrix

exit code: 0 within the limits, 1 not so, 2 cannot run
"""


def add_parser(subparsers: Any) -> None:
    """Add ``answers`` to the subcommands of ``dfvs-robustness``."""
    parser = subparsers.add_parser(
        "answers",
        help="measure answers to commands and the state's rate with busy cores",
        description="Send hold and abort to the real dfvs-service in every state of the gate with "
        "every core busy, and measure the state's rate while the goal is out of view.",
        epilog=_EPILOG,
    )
    add = parser.add_argument
    add("--tries", type=int, default=90, metavar="N", help="commands in all (default: 90)")
    add("--seconds", type=float, default=20.0, metavar="S", help="of the rate (default: 20)")
    add("--json", type=Path, metavar="FILE", help="write the results as JSON")
    parser.set_defaults(run=run)


def run(args: argparse.Namespace) -> int:
    """Measure; 0 if all limits were kept."""
    per_state = -(-args.tries // len(GateState))
    require_range(args, 1, None, "tries", "seconds")
    require_file("--json", args.json)
    take_precedence()
    with tempfile.TemporaryDirectory(prefix="dfvs-answers-") as folder:
        times = run_answers(Path(folder), per_state, args.seconds, _show)
    document = {**dataclasses.asdict(times), "passed": times.passed}
    if args.json is not None:
        write_json(args.json, document)
    print("\n".join(markdown_lines(document)))
    return EXIT_OK if times.passed else EXIT_FAILED


def _show(one: Try) -> None:
    line = f"{one.state:9s} {one.action:6s} {one.answer_ms:6.0f} ms  {one.problem or 'ok'}"
    log(line)
