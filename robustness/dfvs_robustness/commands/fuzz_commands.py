"""``dfvs-robustness fuzz commands``: hostile commands through admission and authority."""

from typing import Any

from dfvs_robustness.commands.fuzz_run import FuzzCommand
from dfvs_robustness.fuzz.commands.replay import REPLAY
from dfvs_robustness.fuzz.commands.target import COMMANDS, CommandTally


def _figures(tally: CommandTally) -> dict[str, Any]:
    return {"outcomes": dict(sorted(tally.outcomes.items()))}


def _text(report: dict[str, Any]) -> str:
    lines = [f"{name:36s}{count:12,}" for name, count in report["outcomes"].items()]
    lines.append(
        f"{report['events']:,} sendings in {report['episodes']:,} episodes, "
        f"{report['wall_s']:.0f} s, {report['events_per_core_second']:,} a core and second"
    )
    return "\n".join(lines)


FUZZ_COMMANDS = FuzzCommand(
    "commands",
    "hostile commands for the operator link and the gate",
    "Send fresh, repeated, replayed, delayed, expired, forged, foreign and broken commands and "
    "goals through the operator link's admission to the gate's authority. What is obeyed must be "
    "signed, fresh and new; the same bytes must get the same answer; rate and memory must stay "
    "bounded. A violation is shrunk to the few sendings that it needs and saved.",
    "commands-once-0.json",
    COMMANDS,
    REPLAY,
    "sendings",
    _figures,
    _text,
)
