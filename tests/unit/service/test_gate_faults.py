"""Failures of threads, as the gate process takes them: shown, logged, and a reason not to fly."""

import contextlib
import signal
import socket

from dfvs_core.gate.events import AmbiguousLink
from dfvs_core.messages.link import GateStatus, from_datagram
from dfvs_service.gate.process import SilentLink, start_autopilot

FAULT = "the thread 'telemetry' failed"


def run_to_the_end(gate):
    gate.stop(signal.SIGTERM, None)
    return gate.run(SilentLink(gate.note))


def test_a_fault_is_shown_in_every_state_and_logged_once_a_report(gate, tmp_path):
    with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as link:
        link.bind(str(tmp_path / "link.sock"))
        link.setblocking(False)
        gate.report(FAULT)
        gate.report(FAULT)
        run_to_the_end(gate)
        states = []
        with contextlib.suppress(BlockingIOError):
            while True:
                states.append(from_datagram(GateStatus, link.recv(65536)))
    assert states
    assert all(state.warnings == (FAULT,) for state in states)
    gate.close()
    assert (tmp_path / "gate.jsonl").read_text().count(FAULT) == 2


def test_another_autopilot_on_the_link_is_told_whatever_the_state(gate, tmp_path):
    gate.emit(AmbiguousLink(1, "autopilots of systems 1 and 7 on one link"))
    run_to_the_end(gate)
    gate.close()
    assert "autopilots of systems 1 and 7" in (tmp_path / "gate.jsonl").read_text()


class Told:
    """Stands in for the gate: what the autopilot's thread tells it."""

    def __init__(self):
        self.reports, self.ends, self.failures = [], [], []
        self.report, self.on_monitor_failed, self.fail = (
            self.reports.append,
            self.ends.append,
            self.failures.append,
        )


def test_a_watch_that_fails_twice_is_reported_twice_and_lost():
    told, runs = Told(), []

    def watch():
        runs.append(1)
        raise KeyError("get_systems")

    start_autopilot(lambda: None, watch, told).join(30.0)
    assert len(runs) == 2
    assert len(told.reports) == 2
    assert told.ends == told.reports[1:]
    assert not told.failures


def test_a_watch_that_ended_keeps_the_gate_from_ready(gate):
    gate.on_monitor_failed("it has ended")
    run_to_the_end(gate)
    checks = {check.name: check for check in gate._machine.checks()}
    assert checks["watch"].detail == "watch lost, it has ended"
