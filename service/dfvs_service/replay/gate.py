"""``dfvs-service replay-gate``: replay of the gate's decisions on a recorded flight."""

import dataclasses
import json
from collections.abc import Sequence
from pathlib import Path

from dfvs_common.command_line import command_parser
from dfvs_common.lifecycle import EXIT_FAILED, EXIT_OK
from dfvs_core.errors import ConfigError, WireError
from dfvs_core.gate.config import S
from dfvs_core.gate.replay import Replay, replay
from dfvs_service.flights.records import started_ns

_EPILOG = """\
example: dfvs-service replay-gate runs/gate-inputs.jsonl

exit code: 0 the gate says the same again, 1 it does not, 2 the file is no journal
"""
_EXPECTED = "the gate-inputs.jsonl of a flight"


def replay_gate(words: Sequence[str]) -> int:
    """Run the command; returns the exit code.

    Raises
    ------
    DfvsError
        If the file cannot be read or is no journal.
    """
    parser = command_parser(
        "dfvs-service replay-gate",
        "Put the inputs that the gate recorded (gate-inputs.jsonl in the runtime "
        "folder) through a fresh gate, and compare what it says with what it said.",
        _EPILOG,
    )
    parser.add_argument("journal", type=Path, metavar="JOURNAL")
    parser.add_argument("--json", action="store_true", help="print the result as JSON")
    arguments = parser.parse_args(words)
    try:
        with arguments.journal.open(encoding="utf-8") as lines:
            result = replay(lines)
    except OSError as error:
        problem = f"cannot read {arguments.journal} ({error.strerror})"
        raise ConfigError(problem, _EXPECTED) from error
    except UnicodeDecodeError as error:
        raise ConfigError(f"{arguments.journal} cannot be used: {error}", _EXPECTED) from error
    except WireError as error:
        problem = f"{arguments.journal} cannot be used: {error.problem}"
        raise ConfigError(problem, error.expected or _EXPECTED) from error
    start_ns = started_ns(arguments.journal.parent) or result.start_ns
    print(json.dumps(dataclasses.asdict(result)) if arguments.json else _as_text(result, start_ns))
    return EXIT_FAILED if result.difference else EXIT_OK


def _as_text(result: Replay, start_ns: int) -> str:
    """Transitions with their time since the start of the flight, and the result."""
    lines = [
        f"{(t.t_ns - start_ns) / S:9.3f} s  {t.source} -> {t.target}  {t.reason}"
        for t in result.transitions
    ]
    lines.append(f"{result.steps} steps, {result.setpoints} setpoints: the gate says the same")
    if result.difference:
        lines[-1] = f"the gate says something else in {result.difference}"
    if result.gap:
        lines.append(f"warning: {result.gap}")
    return "\n".join(lines)
