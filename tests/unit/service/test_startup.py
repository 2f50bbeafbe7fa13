"""How long a start may take, until it is said what is missing."""

import pytest

from dfvs_core.errors import DfvsError
from dfvs_core.gate.config import S
from dfvs_core.gate.states import GateState
from dfvs_core.messages.link import to_datagram
from dfvs_service.gate.startup import startup_problem
from dfvs_service.perception.frame_processor import unhealthy_report

MINUTE_NS = 60 * S


def test_a_model_that_loads_for_minutes_is_no_missing_camera():
    assert startup_problem(10 * MINUTE_NS, None, 15.0, "no report yet") is None
    assert startup_problem(11 * MINUTE_NS, 14 * S, 15.0, "no frame") is None
    error = startup_problem(11 * MINUTE_NS, 15 * S, 15.0, "no frame")
    assert "no usable camera frame within 15 s (no frame)" in str(error)


def test_a_report_before_the_autopilot_is_heard_does_not_shorten_the_time():
    assert startup_problem(14 * S, 113 * S, 15.0, "no frame") is None
    assert startup_problem(15 * S, 114 * S, 15.0, "no frame") is not None


def test_a_perception_that_never_reports_ends_the_service_without_blaming_the_camera():
    assert startup_problem(899 * S, None, 15.0, "no report yet") is None
    error = str(startup_problem(900 * S, None, 15.0, "no report yet"))
    assert "perception reported nothing within 900 s" in error
    assert "camera" not in error


def test_the_gate_counts_from_the_first_report_that_reaches_it(gate):
    gate._machine.state, gate._machine._since = GateState.PREFLIGHT, 0
    assert gate._ending(0) is None
    assert gate._ending(MINUTE_NS) is None
    gate._ipc._read(to_datagram(unhealthy_report(0, 0, "no frame on a/camera")), MINUTE_NS)
    gate._ipc._read(to_datagram(unhealthy_report(0, 0, "no frame on a/camera")), 2 * MINUTE_NS)
    assert gate._ending(MINUTE_NS + 14 * S) is None
    with pytest.raises(DfvsError, match="no usable camera frame within 15 s"):
        gate._ending(MINUTE_NS + 15 * S)
