"""The parent with stand-ins for its children: who is killed when, and what the user reads."""

import contextlib
import io
import json
import os
import signal
import socket
import sys
import threading
import time
from pathlib import Path

import pytest
from waiting import until

from dfvs_core.messages.link import to_gate
from dfvs_service.settings.runtime import RuntimeFolder
from dfvs_service.supervisor.console import ChangeLines
from dfvs_service.supervisor.parent import Parent, Programs

pytestmark = pytest.mark.real_time

FAKE_GATE = str(Path(__file__).parent / "fake_gate.py")
IDLE = "import time; time.sleep(60)"
BROKEN = "import sys; print('noise\\nerror: no such model', file=sys.stderr); sys.exit(2)"
ENDING = """
import pathlib, signal, sys, time
stopped = []
signal.signal(signal.SIGTERM, lambda *_: stopped.append(1))
folder = pathlib.Path(sys.argv[sys.argv.index("--runtime") + 1])
(folder / "NAME.up").touch()
while not stopped:
    time.sleep(0.01)
(folder / "NAME.ended").write_text(str(time.monotonic_ns()))
"""
READING = """
(folder / "seen").write_text((folder / "service.jsonl").read_text())
print("warning: the disk is full", file=sys.stderr)
"""


def ending(name):
    """A child that shows when it is up and when it has ended."""
    return ENDING.replace("NAME", name)


def drain(descriptor):
    """Read until the other end is closed."""
    while os.read(descriptor, 65536):
        pass


def run(folder, gate, perception=IDLE, link=IDLE, *, stop_after_s=None, stop_when=None, **more):
    """Exit code, what the user reads, and how long it took; ``more`` are further children.

    It is told to stop so long after its start, or once something is true of what the user read.
    """
    children = {"perception": perception, "link": link} | more
    programs = Programs(
        (sys.executable, FAKE_GATE, *gate),
        **{name: (sys.executable, "-c", text) for name, text in children.items()},
    )
    stream = io.StringIO()
    parent = Parent(RuntimeFolder(folder), programs, ChangeLines(stream))

    def wait_and_stop():
        until(lambda: stop_when(stream.getvalue()), 20.0)
        parent.stop(signal.SIGTERM, None)

    if stop_when is not None:
        threading.Thread(target=wait_and_stop, daemon=True).start()
    if stop_after_s is not None:
        threading.Timer(stop_after_s, lambda: parent.stop(signal.SIGTERM, None)).start()
    start = time.monotonic()
    code = parent.run()
    starts = folder / "starts"
    assert not starts.exists() or starts.read_text() == "started\n"  # never a second time
    return code, stream.getvalue().splitlines(), time.monotonic() - start


@pytest.mark.parametrize("code", [0, 1, 2])
def test_the_gates_exit_code_and_error_reach_the_user_once(tmp_path, code):
    result, lines, _ = run(tmp_path, ["--code", str(code)])
    assert result == code
    assert lines.count("error: told to end") == 1
    assert lines.count("warning: a parameter is odd") == 1


def test_any_other_end_of_the_gate_is_a_flight_that_did_not_reach(tmp_path):
    assert run(tmp_path, ["--code", "77"])[0] == 1


def test_a_crash_of_the_gate_is_named(tmp_path):
    code, lines, _ = run(tmp_path, ["--crash"])
    assert code == 1
    assert (
        "error: the gate was killed by SIGKILL; the autopilot's failsafe has the vehicle" in lines
    )


CRASHING = "raise KeyError('camera')"


@pytest.mark.parametrize(
    ("gate", "perception", "loss"),
    [
        ([], CRASHING, "perception ended with code 1 (KeyError: 'camera')"),
        (["--crash"], IDLE, "the gate was killed by SIGKILL"),
        (["--code", "1"], IDLE, "the gate ended with code 1 (error: told to end)"),
        ([], BROKEN, ""),
        (["--code", "2"], IDLE, ""),
    ],
)
def test_how_a_process_ended_that_had_to_run_on_is_kept(tmp_path, gate, perception, loss):
    children = {"perception": perception, "link": IDLE}
    programs = Programs(
        (sys.executable, FAKE_GATE, *gate),
        **{name: (sys.executable, "-c", text) for name, text in children.items()},
    )
    stream = io.StringIO()
    parent = Parent(RuntimeFolder(tmp_path), programs, ChangeLines(stream))
    parent.run()
    assert parent.loss == loss
    if perception is CRASHING:
        assert f"warning: {loss}\n" in stream.getvalue()


def test_a_gate_that_hangs_is_killed(tmp_path):
    code, lines, took_s = run(tmp_path, ["--hang", "--deaf"])
    assert code == 1
    assert any("hung and was killed" in line for line in lines)
    assert took_s < 10.0


def test_a_gate_that_does_not_end_when_told_is_killed_within_two_seconds(tmp_path):
    code, lines, took_s = run(tmp_path, ["--deaf"], stop_after_s=1.0)
    assert code == 1
    assert any("did not end in time" in line for line in lines)
    assert took_s < 1.0 + 2.0 + 2.0


def test_slow_children_do_not_hold_up_the_end_either(tmp_path):
    """A deaf gate and every other process deaf too: still within two seconds."""
    deaf = "import signal, time; signal.signal(signal.SIGTERM, signal.SIG_IGN); time.sleep(60)"
    child = (sys.executable, "-c", deaf)
    programs = Programs((sys.executable, FAKE_GATE, "--deaf"), child, child, child, child)
    parent = Parent(RuntimeFolder(tmp_path), programs, ChangeLines(io.StringIO()))
    told = []

    def stop():
        told.append(time.monotonic())
        parent.stop(signal.SIGTERM, None)

    threading.Timer(1.0, stop).start()
    parent.run()
    assert time.monotonic() - told[0] < 2.0 + 2.0  # two seconds, and what a busy machine takes


def test_a_stopped_terminal_does_not_stop_the_watch(tmp_path):
    """The gate hangs while nobody reads: it is killed all the same."""
    read, write = os.pipe()
    os.set_blocking(write, False)
    with contextlib.suppress(BlockingIOError):
        while True:
            os.write(write, b"." * 4096)
    os.set_blocking(write, True)
    gate = (sys.executable, FAKE_GATE, "--hang", "--deaf")
    idle = (sys.executable, "-c", IDLE)
    programs = Programs(gate, idle, link=idle)
    with os.fdopen(write, "w") as stream:
        parent = Parent(RuntimeFolder(tmp_path), programs, ChangeLines(stream))
        start = time.monotonic()
        assert parent.run() == 1
        assert time.monotonic() - start < 10.0
        assert not parent.is_all_shown
        drained = threading.Thread(target=drain, args=(read,))
        drained.start()
    drained.join(5.0)
    os.close(read)


@pytest.mark.parametrize("process", ["perception", "link"])
def test_a_needed_process_that_cannot_run_ends_the_service_with_its_error(tmp_path, process):
    code, lines, _ = run(tmp_path, [], **{process: BROKEN})
    assert code == 2
    assert lines.count("error: no such model") == 1
    assert "noise" not in lines


def test_a_perception_that_ends_in_flight_leaves_the_gate_to_its_own_judgement(tmp_path):
    ends = "import time; time.sleep(0.8)"
    code, lines, took_s = run(tmp_path, ["--state", "SERVO"], ends, stop_after_s=2.0)
    assert code == 1
    assert took_s >= 1.9  # it went on until it was told to stop
    assert "warning: perception ended with code 0" in lines


def test_the_recorder_is_ended_after_perception_and_the_operator_link_after_both(tmp_path):
    names = ("perception", "recorder", "link")
    ups = [tmp_path / "starts", *(tmp_path / f"{name}.up" for name in names)]
    children = {name: ending(name) for name in names}
    run(tmp_path, [], stop_when=lambda _: all(up.exists() for up in ups), **children)
    ended = [int((tmp_path / f"{name}.ended").read_text()) for name in names]
    assert ended == sorted(ended)


@pytest.mark.parametrize("end", ["sys.exit(3)", "os.kill(os.getpid(), 9)"])
def test_a_flight_goes_on_without_its_recorder_and_says_so(tmp_path, end):
    ups = [tmp_path / "perception.up", tmp_path / "starts"]
    code, lines, _ = run(
        tmp_path,
        ["--state", "READY", "--told", "0"],
        ending("perception"),
        recorder=f"import os, sys; {end}",
        stop_when=lambda text: "recorder" in text and all(up.exists() for up in ups),
    )
    assert sum("nothing more is recorded" in line for line in lines) == 1
    assert not [line for line in lines if line.startswith("error")]
    assert code == 0  # by the gate's own word


def test_the_black_box_sees_all_that_the_user_was_told_and_the_exit_code(tmp_path):
    gate = ["--state", "READY", "--crash", "--after", "box.up"]
    code, lines, _ = run(tmp_path, gate, black_box=ending("box") + READING)
    assert code == 1
    seen = [json.loads(line) for line in (tmp_path / "seen").read_text().splitlines()]
    told = [record["text"] for record in seen if record["kind"] == "told"]
    assert "error: the gate was killed by SIGKILL; the autopilot's failsafe has the vehicle" in told
    assert (seen[-1]["kind"], seen[-1]["code"]) == ("end", 1)
    # Its own last line reaches the user all the same.
    assert "warning: the disk is full" in lines


def test_user_and_black_box_are_told_which_check_refuses_and_what_to_do(tmp_path):
    gate = ["--refuses", "the goal is not in view"]
    line = "not ready: frames: the goal is not in view (check the camera)"
    box = ending("box") + READING
    _, lines, _ = run(tmp_path, gate, black_box=box, stop_when=lambda text: line in text)
    assert lines.count(line) == 1
    assert line in (tmp_path / "seen").read_text()


def test_operators_are_told_of_the_end_of_the_black_box_and_of_its_warnings(tmp_path):
    ends = "import sys; print('warning: the disk is slow', file=sys.stderr); sys.exit(3)"
    with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as heard_by_gate:
        heard_by_gate.bind(str(RuntimeFolder(tmp_path).gate_socket))
        heard_by_gate.setblocking(False)
        run(tmp_path, ["--code", "0"], black_box=ends)
        heard = []
        with contextlib.suppress(BlockingIOError):
            while True:
                heard.append(to_gate(heard_by_gate.recv(4096)).service_fault)
    assert sorted(heard) == [
        "the black box ended with code 3; no more of this flight is kept",
        "the disk is slow",
    ]


def test_systemd_is_told_of_the_start_of_life_and_of_the_end(tmp_path, monkeypatch):
    address = tmp_path / "notify"
    with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as systemd:
        systemd.bind(str(address))
        systemd.settimeout(10.0)
        monkeypatch.setenv("NOTIFY_SOCKET", str(address))
        heard = []

        def listen():
            with contextlib.suppress(TimeoutError):
                while heard[-1:] != [b"STOPPING=1"]:
                    heard.append(systemd.recv(100))

        listener = threading.Thread(target=listen)
        listener.start()  # the kernel keeps ten messages at most
        run(tmp_path, ["--code", "0"])
        listener.join()
    assert heard[0] == b"READY=1"
    assert heard[-1] == b"STOPPING=1"
    # The stand-in gate lives for half a second, and a sign of life is due every 100 ms.
    assert heard.count(b"WATCHDOG=1") >= 4
