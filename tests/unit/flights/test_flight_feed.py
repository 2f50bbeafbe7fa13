"""Telemetry for the black box: never waits, whoever listens or does not."""

import socket

import pytest

from dfvs_service.flight_feed import FlightFeed, split_record


@pytest.fixture
def box(tmp_path):
    """A black box's end, which reads only when it is told to."""
    with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as box:
        box.setblocking(False)
        box.bind(str(tmp_path / "box.sock"))
        yield box


@pytest.fixture
def feed(tmp_path):
    feed = FlightFeed(tmp_path / "box.sock")
    yield feed
    feed.close()


def test_a_record_arrives_with_the_name_of_its_stream(feed, box):
    assert feed.put("goal", b"two\nlines")
    assert split_record(box.recv(100)) == ("goal", b"two\nlines")


def test_a_black_box_that_is_not_there_yet_is_told_apart(feed):
    assert not feed.put("state", b"{}")


def test_a_black_box_that_hangs_drops_and_holds_up_nobody(feed, box):
    taken = [feed.put("state", bytes(1000)) for _ in range(5000)]
    assert taken[0]
    assert not taken[-1]
    box.recv(2000)
    assert feed.put("state", b"{}")  # there is room again


def test_a_goal_of_a_few_hundred_kilobytes_fits(feed, box):
    assert feed.put("goal", bytes(300_000))
    assert len(split_record(box.recv(1 << 20))[1]) == 300_000


def test_a_record_of_the_largest_size_fits(feed, box):
    assert feed.put("thumbnail", bytes(feed.max_bytes))
    assert len(split_record(box.recv(1 << 20))[1]) == feed.max_bytes


def test_a_record_that_is_too_large_is_dropped_for_good_and_said_once(feed, box, capsys):
    assert feed.put("goal", bytes(10_000_000))
    assert feed.put("goal", bytes(10_000_000))
    assert feed.put("build", b"{}")
    assert split_record(box.recv(100)) == ("build", b"{}")
    (line,) = capsys.readouterr().err.splitlines()
    assert line.startswith("warning: the black box lacks a record of 'goal'")
