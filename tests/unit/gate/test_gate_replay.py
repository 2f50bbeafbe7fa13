"""A recorded flight, decided again."""

import json
import math
import typing

import pytest
from gate_rehearsal import Rehearsal, auto_config
from hypothesis import given
from hypothesis import strategies as st

from dfvs_core.errors import WireError
from dfvs_core.gate.config import MS, Engage, OnDone, S
from dfvs_core.gate.events import (
    Action,
    AmbiguousLink,
    Attitude,
    BadReport,
    Battery,
    CurrentMode,
    Event,
    ForeignSetpoint,
    GateOutput,
    Health,
    LocalPosition,
    MonitorFailed,
    OperatorCommand,
    OtherServices,
    Report,
    Stop,
    VehicleMode,
    VelocityTarget,
)
from dfvs_core.gate.replay import Step, encode_gap, encode_start, encode_step, read_steps, replay
from dfvs_core.gate.states import GateState


class Recorded(Rehearsal):
    """A rehearsal that writes the journal of its gate."""

    def __post_init__(self):
        super().__post_init__()
        self.lines = [encode_start(self.config, self.now_ns) + "\n"]

    def send(self, events):
        output = super().send(events)
        self.lines.append(encode_step(self.now_ns, events, output) + "\n")
        return output


def eventful_flight():
    """One in which everything happens, by a config that is not the default."""
    gate = Recorded(auto_config(on_done=OnDone.HOLD, max_distance_m=3.0))
    gate.until(GateState.SERVO).run(2.0)
    gate.send([gate.report(healthy=False), BadReport(gate.now_ns, "rubbish")])
    gate.until(GateState.SERVO)
    gate.vehicle.position_m = (math.nan, 0.0, 0.0)
    gate.until(GateState.ABORT)
    gate.vehicle.position_m, gate.vehicle.mode = (1.0, 2.0, -3.0), VehicleMode.HOLD
    gate.run(2.0).send([OperatorCommand(gate.now_ns, Action.ENGAGE)])
    gate.until(GateState.SERVO)
    gate.beat(mode=VehicleMode.POSITION)
    assert gate.state is GateState.RELEASED
    return gate


def test_the_same_inputs_give_the_very_same_commands():
    gate = eventful_flight()
    result = replay(gate.lines)
    assert (result.difference, result.gap) == ("", "")
    assert list(result.transitions) == gate.transitions
    assert result.setpoints == len(gate.setpoints)
    assert result.steps == len(gate.lines) - 1


def test_a_changed_input_is_found():
    gate = eventful_flight()
    at = next(i for i, line in enumerate(gate.lines) if '"to":[["SERVO","HOLD"' in line)
    gate.lines[at] = gate.lines[at].replace('"BadReport"', '"HeardNothing"')
    with pytest.raises(WireError, match="damaged"):
        replay(gate.lines)
    line = json.loads(eventful_flight().lines[at])
    line["in"] = []
    gate.lines[at] = json.dumps(line) + "\n"
    result = replay(gate.lines)
    assert result.difference.startswith(f"step {at - 1} at ")
    assert result.steps == at - 1


def test_a_changed_output_is_found():
    gate = eventful_flight()
    at = next(i for i, line in enumerate(gate.lines) if '"v":[0.1' in line)
    gate.lines[at] = gate.lines[at].replace('"v":[0.1', '"v":[0.2')
    assert "instead of" in replay(gate.lines).difference


def test_what_was_said_up_to_a_difference_is_told():
    gate = eventful_flight()
    at = max(i for i, line in enumerate(gate.lines) if '"v":[0.1' in line)
    gate.lines[at] = gate.lines[at].replace('"v":[0.1', '"v":[0.2')
    result = replay(gate.lines)
    before_ns = json.loads(gate.lines[at])["t"]
    assert result.transitions == tuple(t for t in gate.transitions if t.t_ns <= before_ns)
    assert result.setpoints == sum(t_ns <= before_ns for t_ns, _ in gate.setpoints)


def test_a_journal_names_what_was_asked_for():
    requests = [line for line in eventful_flight().lines if '"mode":"HOLD"' in line]
    assert len(requests) == 1


def test_a_journal_with_former_names_is_replayed():
    gate = Recorded(auto_config(engage=Engage.COMMAND)).run(1.5)
    gate.command(Action.ENGAGE)
    gate.tick(MonitorFailed(gate.now_ns, "failed"))
    text = "".join(gate.lines)
    for present, former in (
        ("OperatorCommand", "Order"),
        ("MonitorFailed", "WatchEnded"),
        ("command_valid_ns", "order_valid_ns"),
    ):
        assert present in text
        text = text.replace(present, former)
    assert replay(text.splitlines(keepends=True)) == replay(gate.lines)


def test_a_gap_and_a_torn_line_end_the_replay():
    gate = Recorded(auto_config()).run(3.0)
    assert gate.setpoints
    cut = [*gate.lines[:140], encode_gap(3) + "\n", *gate.lines[143:]]
    result = replay(cut)
    assert result.gap == "3 or more steps are missing after step 139"
    whole = replay(gate.lines[:140])
    assert (result.steps, result.transitions) == (139, whole.transitions)
    assert result.setpoints == whole.setpoints > 0
    torn = [*gate.lines[:20], gate.lines[20][:-9]]
    assert replay(torn) == replay(gate.lines[:20])


@pytest.mark.parametrize(
    "lines",
    [
        [],
        ["\n"],
        ["{}\n"],
        ["[]\n"],
        ['{"format": "dfvs-gate-journal/1", "t_ns": 1, "config": {"max_distance": 1}}\n'],
        ['{"format": "dfvs-gate-journal/1", "t_ns": 1, "config": []}\n'],
        [encode_start(auto_config(), 1) + "\n", '{"t": 1}\n'],
        [encode_start(auto_config(), 1) + "\n", '{"t": 1, "in": [["Stop", 1]], "out": {}}\n'],
        [encode_start(auto_config(), 1) + "\n", "?\n"],
    ],
)
def test_what_is_no_journal_is_refused(lines):
    with pytest.raises(WireError):
        replay(lines)


def test_a_journal_of_another_format_is_named():
    with pytest.raises(WireError) as refused:
        replay(['{"format": "dfvs-gate-journal/9", "t_ns": 1, "config": {}}\n'])
    text = "the journal has format 'dfvs-gate-journal/9'; expected 'dfvs-gate-journal/1'"
    assert str(refused.value) == text


def test_an_event_with_more_values_than_it_has_is_damaged():
    lines = [encode_start(auto_config(), 1) + "\n"]
    lines.append('{"t": 1, "in": [["BadReport", 1, "x", "more"]], "out": {}}\n')
    with pytest.raises(WireError, match="damaged"):
        replay(lines)


EVENTS: list[Event] = [
    LocalPosition(1, (math.inf, -math.inf, 0.1), (1e-300, 2.0, -0.0)),
    Attitude(2, 0.1, -0.2, 3.0),
    CurrentMode(2, VehicleMode.OFFBOARD),
    Battery(3, None),
    Battery(4, 0.25),
    Health(5, ok=False, detail='a "quoted" ü', can_arm=False),
    OperatorCommand(6, Action.GOAL, "ab" * 32),
    Stop(7, "by SIGTERM", unsupervised=True),
    VelocityTarget(8, (0.1, 0.2, 0.3)),
    ForeignSetpoint(9, "x"),
    AmbiguousLink(9, "systems 3 and 7"),
    OtherServices(10, ("a",), ("b", "c")),
    BadReport(11, ""),
    MonitorFailed(12, "failed"),
]


def test_every_kind_of_event_survives_the_journal():
    gate = Rehearsal(auto_config(engage=Engage.COMMAND))
    events = (*gate.nominal(), gate.heartbeat(), *EVENTS)
    (step,) = read_steps([encode_step(5 * MS, events, GateOutput()) + "\n"])
    assert step == Step(5 * MS, events, {})
    assert {type(e) for e in events} == set(typing.get_args(Event))


@given(st.floats(), st.floats(allow_nan=False), st.integers(0, 1 << 62))
def test_numbers_survive_to_the_last_bit(error_m, velocity, t_ns):
    report = Rehearsal().report(error_m=error_m, velocity=(velocity, 0.0, 0.0, 0.0)).report
    (step,) = read_steps([encode_step(t_ns, [Report(S, report)], GateOutput()) + "\n"])
    assert repr(step.events[0].report) == repr(report)


def test_a_refused_order_is_refused_again():
    gate = Recorded(auto_config()).until(GateState.SERVO)
    gate.command(Action.GOAL, "ab" * 32)
    assert '"refusal":"rejected: the goal cannot change' in gate.lines[-1]
    assert replay(gate.lines).difference == ""
    forged = gate.lines[-1].replace("command hold first", "order abort first")
    assert "command hold first" in replay([*gate.lines[:-1], forged]).difference


def test_steps_after_a_gap_are_read_on():
    lines = [encode_gap(7) + "\n", encode_step(5, [], GateOutput()) + "\n"]
    assert list(read_steps(lines)) == [7, Step(5, (), {})]
