"""The stream of setpoints by itself."""

import pytest

from dfvs_core.gate.config import MS, GateConfig
from dfvs_core.gate.limits import ZERO, BodyVelocity
from dfvs_core.gate.stream import SetpointStream

START = 5_000 * MS
GAP = GateConfig().timing.setpoint_gap_ns
FAST = BodyVelocity(forward_m_s=5.0)


@pytest.fixture
def stream():
    """A stream that has sent its first zero."""
    stream = SetpointStream(GateConfig())
    stream.is_silent = False
    assert stream.zero(START) == ZERO
    return stream


@pytest.mark.parametrize(("after_ns", "is_due"), [(GAP - 1, False), (GAP, True), (GAP + 1, True)])
def test_a_setpoint_is_due_after_the_gap_and_not_a_moment_before(stream, after_ns, is_due):
    assert (stream.move(FAST, START + after_ns, is_reduced=False) is not None) is is_due


@pytest.mark.parametrize(("after_ns", "is_due"), [(GAP - 1, False), (GAP, True)])
def test_zeros_keep_the_same_gap(stream, after_ns, is_due):
    assert (stream.zero(START + after_ns) is not None) is is_due


def test_the_brake_waits_for_no_gap(stream):
    assert stream.move(FAST, START + GAP, is_reduced=False) != ZERO
    assert stream.zero(START + GAP + 1) == ZERO


def test_a_stream_begins_again_from_zero_after_silence(stream):
    stream.move(FAST, START + GAP, is_reduced=False)
    stream.silence()
    assert stream.last == ZERO
    assert stream.zero(START + GAP + 1) is None
    stream.is_silent = False
    first = stream.move(FAST, START + 10_000 * MS, is_reduced=False)
    # 0.5 m/s2 over the 100 ms that one setpoint may use up, however long the silence was.
    assert first.forward_m_s == pytest.approx(0.05)


def test_a_late_setpoint_uses_up_100_ms_at_most(stream):
    late = stream.move(FAST, START + 10_000 * MS, is_reduced=False)
    assert late.forward_m_s == pytest.approx(0.05)


def test_at_reduced_speed_it_is_slower(stream):
    t_ns = START
    for _ in range(50):
        t_ns += 20 * MS
        v = stream.move(FAST, t_ns, is_reduced=True)
    assert v.forward_m_s == pytest.approx(GateConfig().reduced_speed_m_s)


def test_before_the_first_setpoint_the_last_one_counts_as_zero():
    stream = SetpointStream(GateConfig())
    assert stream.last == ZERO
    assert stream.is_silent
