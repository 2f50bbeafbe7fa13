import socket
import time

import pytest
from gate_rehearsal import Rehearsal

from dfvs_core.gate.authority import Authority
from dfvs_core.gate.events import Action, BadReport, Order, Report
from dfvs_core.wire.command import encode_command
from dfvs_core.wire.link import ForwardedCommand, GateStatus, to_datagram
from dfvs_service.beat import Beat
from dfvs_service.gate.post import Post
from dfvs_service.runtime import RuntimeFolder

KEY = b"k" * 32
STATUS, BEAT = GateStatus("IDLE", "", None), Beat(0, "IDLE", "")


@pytest.fixture
def post(tmp_path):
    authority = Authority(KEY, "drone1", lambda: "c", 0)
    return Post(RuntimeFolder(tmp_path), authority, lambda kind, text: None)


def send(tmp_path, *datagrams):
    with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as sender:
        for data in datagrams:
            sender.sendto(data, str(tmp_path / "gate.sock"))


def collected(post):
    return list(post.collect(lambda: 42))


def test_reports_become_events_in_order(post, tmp_path):
    reports = [Rehearsal().report(seq=i).report for i in range(3)]
    send(tmp_path, *map(to_datagram, reports))
    assert collected(post) == [Report(42, report) for report in reports]
    assert collected(post) == []
    assert post.has_seen_frame


def test_a_report_before_any_frame_is_no_frame(post, tmp_path):
    send(tmp_path, to_datagram(Rehearsal().report(t_capture_ns=0).report))
    collected(post)
    assert not post.has_seen_frame


@pytest.mark.parametrize("data", [b"", b"garbage", b"{}", b'{"payload": []}', b"\0" * 60_000])
def test_garbage_becomes_a_bad_report(post, tmp_path, data):
    send(tmp_path, data)
    (event,) = collected(post)
    assert isinstance(event, BadReport)
    assert len(event.detail) <= 200


def test_only_an_authentic_command_becomes_an_order(post, tmp_path):
    good = encode_command(KEY, "drone1", Action.HOLD, "c").decode()
    send(tmp_path, to_datagram(ForwardedCommand("\ud800")), to_datagram(ForwardedCommand(good)))
    assert collected(post) == [Order(42, Action.HOLD)]
    assert post.command_count == 2
    assert post.command_result == "accepted: hold"


def test_an_order_for_a_goal_says_which(post, tmp_path):
    data = encode_command(KEY, "drone1", Action.GOAL, "c", "ab" * 32).decode()
    send(tmp_path, to_datagram(ForwardedCommand(data)))
    assert collected(post) == [Order(42, Action.GOAL, "ab" * 32)]


def test_an_order_that_the_state_forbids_is_answered_so(post):
    post.answer("rejected: not now" + "!" * 300)
    assert post.command_result.startswith("rejected: not now!")
    assert len(post.command_result) == 200


def test_sending_never_waits_for_a_reader_that_is_not_there_or_does_not_read(post, tmp_path):
    post.send(STATUS, BEAT)
    with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as deaf:
        deaf.bind(str(tmp_path / "perception.sock"))
        start = time.monotonic()
        for _ in range(1000):
            post.send(STATUS, BEAT)
        # A thousand datagrams that are dropped take milliseconds; one that waits, for ever.
        assert time.monotonic() - start < 2.0
    post.send(STATUS, BEAT)
