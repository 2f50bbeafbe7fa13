"""``dfvs-robustness fuzz``: what must hold whatever comes in, tried by the million."""

from typing import Any

from dfvs_robustness.commands import fuzz_frames
from dfvs_robustness.commands.fuzz_run import FuzzCommand
from dfvs_robustness.fuzz.commands import target as commands
from dfvs_robustness.fuzz.gate import target as gate


def _gate_figures(tally: gate.GateTally) -> dict[str, Any]:
    return {
        "steps": tally.steps,
        "steps_that_move": tally.moving,
        "episodes_run_twice": tally.twins,
        "events_by_kind": dict(tally.kinds.most_common()),
        "steps_by_state": dict(tally.states.most_common()),
        "transitions": dict(tally.transitions.most_common()),
        "causes": dict(tally.causes.most_common()),
    }


def _gate_text(report: dict[str, Any]) -> str:
    states = ", ".join(f"{name} {steps:,}" for name, steps in report["steps_by_state"].items())
    return (
        f"{report['events']:,} events in {report['steps']:,} steps of {report['episodes']:,} "
        f"episodes, {report['wall_s']:.0f} s, "
        f"{report['events_per_core_second']:,} events a core and second\n"
        f"steps by state: {states}\n"
        f"{len(report['transitions'])} kinds of transition, {len(report['causes'])} causes"
    )


FUZZ_GATE = FuzzCommand(
    "gate",
    "random inputs for the gate's state machine",
    "Run the gate through random flights: perception, vehicle, pilot, operator and clock behave, "
    "then go wrong. After every step the invariants I1 to I9 are checked by a second, independent "
    "judgement of all that the gate was told. A violation is shrunk to the few steps that it "
    "needs and saved.",
    "gate-I4-0.json",
    gate.GATE,
    "steps",
    _gate_figures,
    _gate_text,
)


def _command_figures(tally: commands.CommandTally) -> dict[str, Any]:
    return {"outcomes": dict(sorted(tally.outcomes.items()))}


def _command_text(report: dict[str, Any]) -> str:
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
    commands.COMMANDS,
    "sendings",
    _command_figures,
    _command_text,
)


def add_parser(subparsers: Any) -> None:
    """Add ``fuzz`` and its own subcommands to those of ``dfvs-robustness``."""
    parser = subparsers.add_parser(
        "fuzz",
        help="random inputs for the gate, hostile commands for its ingress, frames for the decoder",
        description="Try to break the gate's invariants with random inputs, the operator link "
        "with hostile commands, or the decoder with hostile frames.",
    )
    inner = parser.add_subparsers(metavar="WHAT", required=True)
    FUZZ_GATE.add_parser(inner)
    FUZZ_COMMANDS.add_parser(inner)
    fuzz_frames.add_parser(inner)
