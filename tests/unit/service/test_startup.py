"""How long a start may take, until it is said what is missing."""

import pytest

from dfvs_core.errors import DfvsError
from dfvs_core.gate.config import S
from dfvs_core.gate.states import GateState
from dfvs_core.messages.link import to_datagram
from dfvs_service.gate.startup import StartupWatch
from dfvs_service.perception.frame_processor import unhealthy_report

MINUTE_NS = 60 * S


def test_a_model_that_loads_for_minutes_is_no_missing_camera():
    watch = StartupWatch(15.0)
    assert watch.evaluate(0, None, "no report yet") is None
    assert watch.evaluate(10 * MINUTE_NS, None, "no report yet") is None
    reported_ns = 11 * MINUTE_NS
    assert watch.evaluate(reported_ns + 14 * S, reported_ns, "no frame") is None
    error = watch.evaluate(reported_ns + 15 * S, reported_ns, "no frame")
    assert "no usable camera frame within 15 s (no frame)" in str(error)


def test_a_report_before_the_autopilot_is_heard_does_not_shorten_the_time():
    watch = StartupWatch(15.0)
    assert watch.evaluate(100 * S, 1 * S, "no frame") is None
    assert watch.evaluate(114 * S, 1 * S, "no frame") is None
    assert watch.evaluate(115 * S, 1 * S, "no frame") is not None


def test_a_perception_that_never_reports_ends_the_service_without_blaming_the_camera():
    watch = StartupWatch(15.0)
    watch.evaluate(0, None, "no report yet")
    assert watch.evaluate(899 * S, None, "no report yet") is None
    error = str(watch.evaluate(900 * S, None, "no report yet"))
    assert "perception reported nothing within 900 s" in error
    assert "camera" not in error


def test_the_gate_counts_from_the_first_report_that_reaches_it(gate):
    gate._machine.state = GateState.PREFLIGHT
    assert gate._ending(0) is None
    assert gate._ending(MINUTE_NS) is None
    gate._ipc._read(to_datagram(unhealthy_report(0, 0, "no frame on a/camera")), MINUTE_NS)
    gate._ipc._read(to_datagram(unhealthy_report(0, 0, "no frame on a/camera")), 2 * MINUTE_NS)
    assert gate._ending(MINUTE_NS + 14 * S) is None
    with pytest.raises(DfvsError, match="no usable camera frame within 15 s"):
        gate._ending(MINUTE_NS + 15 * S)
