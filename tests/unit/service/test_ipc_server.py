import contextlib
import socket
import time

import pytest
from gate_rehearsal import Rehearsal
from signed_commands import signed

from dfvs_core.gate.commands.authority import Authority
from dfvs_core.gate.commands.command import request_id
from dfvs_core.gate.events import Action, BadReport, OperatorCommand, Report
from dfvs_core.messages.link import (
    CommandAnswer,
    ForwardedCommand,
    GateStatus,
    ServiceFault,
    from_gate,
    to_datagram,
)
from dfvs_service.gate.ipc_server import IpcServer
from dfvs_service.settings.runtime import RuntimeFolder
from dfvs_service.supervisor.heartbeat import Heartbeat

KEY = b"k" * 32
FAULTS = []
STATUS, BEAT = GateStatus("IDLE", "", None), Heartbeat(0, "IDLE", "")


@pytest.fixture
def post(tmp_path):
    authority = Authority(KEY, "drone1", lambda: "c", 0)
    return IpcServer(RuntimeFolder(tmp_path), authority, lambda kind, text: None, FAULTS.append)


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
    good = signed(KEY, "drone1", Action.HOLD, "c").decode()
    send(tmp_path, to_datagram(ForwardedCommand("\ud800")), to_datagram(ForwardedCommand(good)))
    assert collected(post) == [OperatorCommand(42, Action.HOLD)]
    assert post.command_count == 2
    assert post.command_result == "accepted: hold"


def test_an_order_for_a_goal_says_which(post, tmp_path):
    data = signed(KEY, "drone1", Action.GOAL, "c", "ab" * 32).decode()
    send(tmp_path, to_datagram(ForwardedCommand(data)))
    assert collected(post) == [OperatorCommand(42, Action.GOAL, "ab" * 32)]


@pytest.fixture
def link(tmp_path):
    """The operator link's end: gives the answers that arrived."""
    with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as end:
        end.bind(str(tmp_path / "link.sock"))
        end.setblocking(False)

        def answers():
            found = []
            with contextlib.suppress(BlockingIOError):
                while True:
                    found.append(from_gate(end.recv(65536)))
            return found

        yield answers


def command(key=KEY, action=Action.HOLD):
    data = signed(key, "drone1", action, "c")
    return to_datagram(ForwardedCommand(data.decode())), request_id(data)


def test_a_command_is_answered_by_its_id_once_the_state_machine_has_taken_it(post, link, tmp_path):
    datagram, request = command()
    send(tmp_path, datagram)
    assert len(collected(post)) == 1
    assert link() == []
    post.answer_accepted("")
    assert link() == [CommandAnswer(request, "accepted: hold")]
    post.answer_accepted("")
    assert link() == []


def test_a_repeated_command_gets_the_same_answer_and_is_no_order(post, link, tmp_path):
    datagram, request = command()
    send(tmp_path, datagram, datagram)
    assert len(collected(post)) == 1
    post.answer_accepted("rejected: not now")
    send(tmp_path, datagram)
    assert collected(post) == []
    assert link() == [CommandAnswer(request, "rejected: not now")] * 3
    assert (post.command_count, post.command_result) == (1, "rejected: not now")


def test_the_answer_to_one_command_is_not_that_to_another(post, link, tmp_path):
    good, accepted = command()
    forged, rejected = command(b"x" * 32, Action.ABORT)
    send(tmp_path, good, forged)
    collected(post)
    post.answer_accepted("")
    collected(post)
    assert {(answer.request, answer.result.split(",")[0]) for answer in link()} == {
        (rejected, "rejected: wrong signature"),
        (accepted, "accepted: hold"),
    }


def test_each_of_two_commands_gets_its_own_answer(post, link, tmp_path):
    """Two operators may send one each within the same step."""
    hold, abort = command(), command(action=Action.ABORT)
    send(tmp_path, hold[0], abort[0])
    assert [event.action for event in collected(post)] == [Action.HOLD]
    post.answer_accepted("rejected: not now")
    assert [event.action for event in collected(post)] == [Action.ABORT]
    post.answer_accepted("")
    assert link() == [
        CommandAnswer(hold[1], "rejected: not now"),
        CommandAnswer(abort[1], "accepted: abort"),
    ]


def test_an_order_that_the_state_forbids_is_answered_so(post, link, tmp_path):
    datagram, _ = command()
    send(tmp_path, datagram)
    collected(post)
    post.answer_accepted("rejected: not now" + "!" * 300)
    (answer,) = link()
    assert answer.result == post.command_result
    assert post.command_result.startswith("rejected: not now!")
    assert len(post.command_result) == 200


def test_a_refusal_without_a_command_answers_nobody(post, link):
    post.answer_accepted("rejected: not now")
    assert link() == []
    assert post.command_result == ""


def test_a_thread_s_fault_is_passed_on_and_is_no_event(post, tmp_path):
    FAULTS.clear()
    send(tmp_path, to_datagram(ServiceFault("telemetry failed" + "!" * 300)))
    assert collected(post) == []
    (line,) = FAULTS
    assert line.startswith("telemetry failed!")
    assert len(line) == 200


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
