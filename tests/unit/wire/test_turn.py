"""What recorders are told, on the wire."""

import json
import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from dfvs_core.errors import ConfigError, WireError
from dfvs_core.messages.frame_record import FrameInput, FrameRecord, SessionHeader, pack, unpack
from dfvs_core.messages.link import GateStatus, PerceptionReport, VehicleState
from dfvs_core.messages.schema import dump, from_json

finite = st.floats(allow_nan=False, allow_infinity=False)
triple = st.tuples(finite, finite, finite)


@given(finite, triple, triple, st.binary(max_size=99), st.integers(0, 2**62))
def test_a_turn_comes_back_to_the_last_bit(angle, velocity, position, payload, t_ns):
    vehicle = VehicleState(t_ns, angle, -angle, angle / 3, velocity, position)
    report = PerceptionReport(
        7, t_ns, (*velocity, angle), True, False, False, "", abs(angle), 0.1, 0.9, None
    )
    sight = FrameInput("00ff", t_ns, t_ns + 1, None, {"match": 3})
    turn = FrameRecord(
        5, t_ns, t_ns, (GateStatus("SERVO", "", vehicle),), report, sight, {"a": [angle]}
    )
    back, beside = unpack(FrameRecord, pack(turn, payload))
    assert back == turn
    assert beside == payload
    assert math.copysign(1.0, back.heard[0].vehicle.pitch_rad) == math.copysign(1.0, -angle)


@given(st.binary(max_size=200))
def test_rubbish_is_refused(data):
    with pytest.raises(WireError):
        unpack(FrameRecord, data)
    with pytest.raises(WireError):
        unpack(SessionHeader, b"DFVT" + data)


def test_a_length_that_leads_out_of_the_bytes_is_refused():
    with pytest.raises(WireError):
        unpack(FrameRecord, b"DFVT\xff\xff\xff\xff{}")


def test_an_opening_without_the_time_of_an_observation_is_still_read():
    opening = SessionHeader("v", 0, 0, "", 0, {}, {}, {}, {})
    old = {name: value for name, value in dump(opening).items() if name != "observed_ns"}
    assert from_json(SessionHeader, json.dumps(old).encode()) == opening


def test_an_opening_of_another_format_is_refused():
    with pytest.raises(ConfigError, match="dfvs-record/9"):
        SessionHeader("v", 0, 0, "", 0, {}, {}, {}, {}, format="dfvs-record/9")
