"""EventQueue, journal, beat, runtime folder and console: what carries things between processes."""

import io
import json
import os
import select
from pathlib import Path

import numpy as np
import pytest

from dfvs_core.errors import ConfigError, WireError
from dfvs_core.gate.events import Battery
from dfvs_core.geometry.camera import CameraModel
from dfvs_core.messages.goal import Goal, GoalSidecar
from dfvs_core.messages.schema import from_json, to_json
from dfvs_service.gate import event_queue as inbox_module
from dfvs_service.gate.event_queue import EventQueue
from dfvs_service.settings.config import ServiceConfig
from dfvs_service.settings.runtime import RuntimeFolder
from dfvs_service.supervisor.console import ChangeLines, JsonLines, LiveLine, describe
from dfvs_service.supervisor.heartbeat import Heartbeat
from dfvs_service.supervisor.journal import MAX_WAITING, Journal
from dfvs_service.supervisor.parent import prepare_runtime

SERVO = Heartbeat(1, "SERVO", "OFFBOARD confirmed", error_m=0.5, error_rad=0.1)


def wakes(inbox):
    return bool(select.select([inbox], [], [], 0)[0])


def test_an_event_wakes_the_loop_and_waits_in_order():
    inbox = EventQueue()
    assert not wakes(inbox)
    events = [Battery(i, 0.5) for i in range(3)]
    for event in events:
        inbox.put(event)
    assert wakes(inbox)
    assert inbox.drain() == events
    assert not wakes(inbox)
    assert inbox.drain() == []


def test_a_full_inbox_drops_the_oldest_and_never_blocks():
    inbox = EventQueue()
    count = 3 * inbox_module.MAX_WAITING + 70_000  # more wake-up bytes than a pipe holds
    for i in range(count):
        inbox.put(Battery(i, 0.5))
    taken = inbox.drain()
    assert len(taken) == inbox_module.MAX_WAITING
    assert taken[-1].t_ns == count - 1


def test_what_a_child_said_in_an_earlier_run_is_none_of_this_one(tmp_path):
    runtime = RuntimeFolder(tmp_path)
    runtime.stderr("recorder").write_text("warning: the disk is full\n")
    sidecar = GoalSidecar(CameraModel.from_horizontal_fov(64, 48, 1.2))
    prepare_runtime(runtime, ServiceConfig(), Goal(np.zeros((48, 64, 3), np.uint8), sidecar))
    assert runtime.stderr_files() == []


def test_the_journal_writes_json_lines(tmp_path):
    told = []
    journal = Journal(tmp_path / "log", told.append)
    journal.add(5, "transition", source="IDLE", target="PREFLIGHT")
    journal.close()
    record = json.loads((tmp_path / "log").read_text())
    assert record == {"t_ns": 5, "kind": "transition", "source": "IDLE", "target": "PREFLIGHT"}
    assert told == []


def test_a_full_disk_drops_records_and_stops_nobody():
    told = []
    journal = Journal(Path("/dev/full"), told.append)  # accepts no byte
    for i in range(10):
        journal.add(i, "note")
    journal.close()
    assert told == ["warning: full lacks 10 lines"]


def test_a_slow_disk_drops_records_and_blocks_nobody(tmp_path):
    pipe = tmp_path / "pipe"
    os.mkfifo(pipe)
    reader = os.open(pipe, os.O_RDONLY | os.O_NONBLOCK)  # opened, and never read
    told = []
    journal = Journal(pipe, told.append)
    for i in range(2 * MAX_WAITING):
        journal.add(i, "note", text="x" * 200)
    journal.close(0.05)
    os.close(reader)
    assert [line for line in told if line.startswith("warning: pipe lacks ")]


def test_a_beat_survives_the_wire():
    assert from_json(Heartbeat, to_json(SERVO)) == SERVO


@pytest.mark.parametrize("data", [b"", b"[]", b'{"t_ns": "x"}', b"\xff"])
def test_what_is_no_beat_is_an_error(data):
    with pytest.raises(WireError):
        from_json(Heartbeat, data)


def test_a_runtime_folder_with_too_long_a_name_is_refused(tmp_path):
    with pytest.raises(ConfigError, match="too long a name"):
        RuntimeFolder(tmp_path / ("x" * 100))


def test_a_state_is_described_in_one_line():
    assert describe(SERVO) == "SERVO      error  0.500 m   5.7°  OFFBOARD confirmed"
    assert describe(Heartbeat(1, "IDLE", "")) == "IDLE"


def test_without_a_terminal_every_change_of_state_is_a_line():
    stream = io.StringIO()
    display = ChangeLines(stream)
    for state in ("IDLE", "IDLE", "READY", "READY", "IDLE"):
        display.show(Heartbeat(1, state, ""))
    display.log("warning: x")
    display.close()
    assert stream.getvalue() == "IDLE\nREADY\nIDLE\nwarning: x\n"


def test_a_terminal_gets_one_line_that_is_rewritten():
    stream = io.StringIO()
    stream.isatty = lambda: True
    display = LiveLine(stream, 20)
    display.show(SERVO)
    display.log("warning: x")
    display.show(SERVO)
    display.close()
    clear = "\r\x1b[K"
    line = describe(SERVO)[:19]
    assert stream.getvalue() == f"{clear}{line}{clear}warning: x\n{clear}{line}\n"


def test_the_log_is_passed_on_as_it_grows_whole_lines_only(tmp_path):
    log, stream = tmp_path / "log", io.StringIO()
    display = JsonLines(log, stream)
    display.show(SERVO)
    log.write_text('{"a": 1}\n{"b"')
    display.show(SERVO)
    assert stream.getvalue() == '{"a": 1}\n'
    with log.open("a") as file:
        file.write(": 2}\n")
    display.close()
    assert stream.getvalue() == '{"a": 1}\n{"b": 2}\n'
