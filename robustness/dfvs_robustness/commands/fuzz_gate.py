"""``dfvs-robustness fuzz gate``: random inputs, and the invariants after every step."""

from typing import Any

from dfvs_robustness.commands.fuzz_run import FuzzCommand
from dfvs_robustness.fuzz.gate.replay import REPLAY
from dfvs_robustness.fuzz.gate.target import GATE, GateTally


def _figures(tally: GateTally) -> dict[str, Any]:
    return {
        "steps": tally.steps,
        "steps_that_move": tally.moving,
        "episodes_run_twice": tally.twins,
        "events_by_kind": dict(tally.kinds.most_common()),
        "steps_by_state": dict(tally.states.most_common()),
        "transitions": dict(tally.transitions.most_common()),
        "causes": dict(tally.causes.most_common()),
    }


def _text(report: dict[str, Any]) -> str:
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
    GATE,
    REPLAY,
    "steps",
    _figures,
    _text,
)
