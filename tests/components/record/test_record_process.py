"""The recorder as a process, fed over a real Zenoh."""

import contextlib
import signal
import subprocess
import sys
import time

import numpy as np
import pytest
from mcap.reader import make_reader
from recorded_flight import fly
from waiting import until

from dfvs_core.messages.frame import PixelFormat
from dfvs_core.messages.frame_record import SessionHeader, unpack
from dfvs_core.messages.topics import Topics
from dfvs_service.perception import record_publisher
from dfvs_service.perception.record_publisher import MAX_WAITING_BYTES, RecordPublisher
from dfvs_service.replay.comparison import compare
from dfvs_service.replay.flight import Trial, replay
from dfvs_service.replay.recording import read_recording

pytestmark = pytest.mark.real_time

TOPICS = Topics("bottled")
START_S = 30.0


@pytest.fixture(scope="module")
def flight():
    return fly(np.random.default_rng(5), 12, PixelFormat.RGB8)


@contextlib.contextmanager
def running_recorder(endpoint, folder):
    """The command as a process, which is killed at the end."""
    words = ["--vehicle", "bottled", "--set", f'zenoh.listen=["{endpoint}"]']
    command = [sys.executable, "-m", "dfvs_service.record.cli", "--out", str(folder), *words]
    pipes = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE, "text": True}
    with subprocess.Popen(command, **pipes) as recorder:
        try:
            yield recorder
        finally:
            recorder.kill()


def publisher(session, **options):
    """Publisher of frame records, which is closed at the end."""
    return contextlib.closing(RecordPublisher(session, TOPICS, print, **options))


def feed_all(feed, events):
    for message, payload in events:
        feed.offer(message, payload)


def size(folder):
    return sum(path.stat().st_size for path in folder.glob("*.mcap"))


def test_a_flight_is_recorded_from_its_first_turn_though_the_recorder_comes_later(
    service, flight, tmp_path
):
    session, endpoint = service
    with publisher(session, patience_s=START_S) as feed:
        feed_all(feed, flight.events)
        with running_recorder(endpoint, tmp_path) as recorder:
            assert until(lambda: size(tmp_path) > 1_000_000, START_S)
            time.sleep(0.3)
            recorder.send_signal(signal.SIGINT)
            out, errors = recorder.communicate(timeout=START_S)
    assert recorder.returncode == 0, errors
    assert f"{len(flight.turns)} records, " in out
    assert "0 missing, 0 dropped" in out
    (path,) = tmp_path.glob("*.mcap")
    with path.open("rb") as file:
        assert make_reader(file).get_summary().statistics.message_count > len(flight.events)
    result = replay([path], Trial(), lambda _: None)
    assert result.reasons == ()
    assert compare(result.frames).is_identical


def test_killed_without_warning_it_leaves_all_but_the_last_chunk(service, flight, tmp_path):
    session, endpoint = service
    with publisher(session, patience_s=START_S) as feed:
        feed_all(feed, flight.events)
        with running_recorder(endpoint, tmp_path):
            assert until(lambda: size(tmp_path) > 700_000, START_S)
    (path,) = tmp_path.glob("*.mcap")
    entries = list(read_recording([path]))
    turns = [entry.message for entry in entries[1:]]
    assert len(turns) > 2
    assert turns == flight.turns[: len(turns)]


def test_who_joins_in_the_middle_is_told_with_what_the_turns_work(service, flight, tmp_path):
    session, endpoint = service
    with publisher(session) as feed:
        feed_all(feed, flight.events[:5])  # nobody listens yet
        with running_recorder(endpoint, tmp_path) as recorder:
            assert until(lambda: feed.wanted, START_S)
            feed_all(feed, flight.events[5:])
            assert until(lambda: size(tmp_path) > 500_000, START_S)
            time.sleep(0.3)
            recorder.send_signal(signal.SIGTERM)
            recorder.communicate(timeout=START_S)
    entries = [entry.message for entry in read_recording(list(tmp_path.glob("*.mcap")))]
    assert entries[0] == flight.opening
    assert entries[1:] == flight.turns[4:]


def test_a_header_that_was_missed_is_repeated_with_a_later_record(service, flight, monkeypatch):
    monkeypatch.setattr(record_publisher, "_HEADER_PERIOD_S", 0.0)
    session, _ = service
    headers, records = [], []
    with publisher(session) as feed:
        feed.offer(*flight.events[0])
        # A subscriber of Zenoh's plain kind does not ask for the kept value.
        subscribers = [
            session.declare_subscriber(TOPICS.telemetry(name), heard.append)
            for name, heard in (("opening", headers), ("turn", records))
        ]
        assert until(lambda: feed.wanted, START_S)
        headers.clear()
        feed.offer(*flight.events[1])
        assert until(lambda: bool(records), START_S)
    for subscriber in subscribers:
        subscriber.undeclare()
    header, _ = unpack(SessionHeader, headers[-1].payload.to_bytes())
    assert header == flight.opening


def test_a_recorder_that_never_comes_costs_a_bounded_memory_and_no_time(service, flight):
    session, _ = service
    feed = RecordPublisher(session, TOPICS, print, patience_s=60.0)
    feed_all(feed, flight.events[:1])
    turn, payload = flight.turns[0], bytes(1024 * 1024)
    start = time.monotonic()
    for _ in range(100):
        feed.offer(turn, payload)
    assert time.monotonic() - start < 2.0
    assert feed.dropped >= 100 - MAX_WAITING_BYTES // len(payload)
    feed.close(0.05)


def test_a_recorder_that_hangs_delays_nobody(service, flight, tmp_path):
    """Publishing to it blocks for seconds; that is its own thread's trouble alone."""
    session, endpoint = service
    heard = []
    telemetry = session.declare_publisher(TOPICS.telemetry("servo"))
    subscriber = session.declare_subscriber(TOPICS.telemetry("servo"), heard.append)
    with publisher(session) as feed:
        feed.offer(*flight.events[0])
        with running_recorder(endpoint, tmp_path) as recorder:
            assert until(lambda: feed.wanted, START_S)
            recorder.send_signal(signal.SIGSTOP)
            turn, payload = flight.turns[0], bytes(1024 * 1024)
            longest, last = 0.0, time.monotonic()
            for _ in range(300):
                feed.offer(turn, payload)
                now = time.monotonic()
                longest, last = max(longest, now - last), now
                time.sleep(0.01)
            telemetry.put(b"still told")
            assert until(lambda: bool(heard), START_S)
    subscriber.undeclare()
    assert feed.dropped > 100
    assert longest < 0.5  # a put that kept the interpreter to itself would take seconds


def test_while_nobody_records_nothing_is_kept(service, flight):
    session, _ = service
    with publisher(session) as feed:
        assert not feed.wanted
        for _ in range(200):
            feed.offer(flight.turns[0], bytes(1024 * 1024))
        assert feed.dropped == 0
