import dataclasses
import json

import pytest
from gate_rehearsal import Rehearsal
from hypothesis import given
from hypothesis import strategies as st

from dfvs_core.errors import WireError
from dfvs_core.messages.link import (
    MAX_DATAGRAM_BYTES,
    CommandAnswer,
    ForwardedCommand,
    GateStatus,
    LeaseHolders,
    PerceptionReport,
    ServiceFault,
    VehicleState,
    from_datagram,
    from_gate,
    to_datagram,
    to_gate,
)

REPORT = Rehearsal().report().report
STATUS = GateStatus(
    state="SERVO",
    cause="OFFBOARD confirmed",
    vehicle=VehicleState(1, 0.1, -0.1, 3.0, (0.1, 0.2, 0.3), (1.0, 2.0, -3.0)),
    t_ns=7,
    battery=0.5,
    heartbeat_age_s=0.2,
    challenge="ab",
    warnings=("one", "two"),
)


@pytest.mark.parametrize("message", [REPORT, STATUS, dataclasses.replace(STATUS, vehicle=None)])
def test_messages_survive_the_wire(message):
    assert from_datagram(type(message), to_datagram(message)) == message


def test_the_gate_tells_reports_from_commands():
    command = ForwardedCommand('{"vehicle": "drone1"}')
    assert to_gate(to_datagram(REPORT)) == REPORT
    assert to_gate(to_datagram(command)) == command
    for message in (LeaseHolders(("a",)), ServiceFault("telemetry failed")):
        assert to_gate(to_datagram(message)) == message


@pytest.mark.parametrize("message", [STATUS, CommandAnswer("ab" * 16, "accepted: hold")])
def test_states_are_told_from_answers(message):
    assert from_gate(to_datagram(message)) == message


@pytest.mark.parametrize("name", ["velocity", "error_m", "overlap", "feature_error"])
@pytest.mark.parametrize("word", ["NaN", "Infinity", "-Infinity"])
def test_numbers_that_are_not_finite_are_refused(name, word):
    data = json.loads(to_datagram(REPORT))
    data[name] = [0, 0, 0, "X"] if name == "velocity" else "X"
    with pytest.raises(WireError):
        to_gate(json.dumps(data).replace('"X"', word).encode())


@given(st.binary(max_size=300))
def test_garbage_is_refused(data):
    with pytest.raises(WireError):
        to_gate(data)


@pytest.mark.parametrize(
    "data", [b"", b"null", b"[" * 4000, b'{"payload": 1}', b" " * (MAX_DATAGRAM_BYTES + 1)]
)
def test_what_does_not_follow_the_schema_is_refused(data):
    with pytest.raises(WireError):
        to_gate(data)


def test_half_a_report_is_refused():
    data = json.loads(to_datagram(REPORT))
    del data["healthy"]
    with pytest.raises(WireError, match="healthy"):
        from_datagram(PerceptionReport, json.dumps(data).encode())
