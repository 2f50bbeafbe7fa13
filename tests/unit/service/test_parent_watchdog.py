import os

import pytest

from dfvs_core.gate.config import MS, S
from dfvs_service.gate.parent_watchdog import ParentWatchdog

START_NS = 9 * S


@pytest.fixture
def pipe():
    reader, writer = os.pipe()
    yield reader, writer
    os.close(reader)


def test_signs_of_life_keep_the_gate_going(pipe):
    reader, writer = pipe
    parent_watchdog, now_ns = ParentWatchdog(reader, START_NS), START_NS
    for _ in range(50):
        os.write(writer, b".")
        now_ns += 900 * MS
        assert parent_watchdog.poll(now_ns) is None
        assert parent_watchdog.poll(now_ns + 50 * MS) is None
    os.close(writer)


def test_a_second_of_silence_is_an_order_to_stop_given_once(pipe):
    reader, writer = pipe
    parent_watchdog = ParentWatchdog(reader, START_NS)
    assert parent_watchdog.poll(START_NS + 1 * S) is None
    stop = parent_watchdog.poll(START_NS + 1 * S + 1)
    assert stop is not None
    assert stop.unsupervised
    assert parent_watchdog.poll(START_NS + 5 * S) is None
    os.close(writer)


def test_the_end_of_the_pipe_is_an_order_to_stop_at_once(pipe):
    reader, writer = pipe
    parent_watchdog = ParentWatchdog(reader, START_NS)
    os.write(writer, b".")
    os.close(writer)
    assert parent_watchdog.poll(START_NS + 1) is None  # what was written before is read first
    stop = parent_watchdog.poll(START_NS + 2)
    assert stop is not None
    assert stop.detail == "it has ended"
    assert parent_watchdog.is_cut
