"""What the service does with its recorder: starts it, outlives it, ends it last."""

import signal
import sys
import threading
import time

import pytest

from dfvs_service.settings.runtime import RuntimeFolder
from dfvs_service.supervisor.parent import Parent, Programs

pytestmark = pytest.mark.real_time

BEATING = """
import json, pathlib, signal, socket, sys, time
stopped = []
signal.signal(signal.SIGTERM, lambda *_: stopped.append(1))
folder = sys.argv[sys.argv.index("--runtime") + 1]
parent = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM)
while not stopped:
    beat = {"t_ns": time.monotonic_ns(), "state": "READY", "cause": ""}
    parent.sendto(json.dumps(beat).encode(), folder + "/parent.sock")
    (pathlib.Path(folder) / "gate.up").touch()
    time.sleep(0.02)
"""
ENDING = """
import os, pathlib, signal, sys, time
stopped = []
signal.signal(signal.SIGTERM, lambda *_: stopped.append(1))
folder = pathlib.Path(sys.argv[sys.argv.index("--runtime") + 1])
(folder / "NAME.up").touch()
while not stopped:
    time.sleep(0.01)
(folder / "NAME.ended").write_text(str(time.monotonic_ns()))
"""


class Said:
    def __init__(self):
        self.lines = []

    def show(self, beat):
        pass

    def log(self, line):
        self.lines.append(line)

    def close(self):
        pass


def run_service(folder, recorder, until):
    """The parent with stand-ins for gate and perception; gives exit code and what was said."""
    said = Said()
    perception = (sys.executable, "-c", ENDING.replace("NAME", "perception"))
    link = (sys.executable, "-c", ENDING.replace("NAME", "link"))
    programs = Programs((sys.executable, "-c", BEATING), perception, recorder, link)
    parent = Parent(RuntimeFolder(folder), programs, said)

    def stop():
        deadline = time.monotonic() + 20.0
        while not until(said.lines) and time.monotonic() < deadline:
            time.sleep(0.02)
        parent.stop(signal.SIGTERM, None)

    threading.Thread(target=stop, daemon=True).start()
    return parent.run(), said.lines


def test_the_recorder_is_ended_after_perception_and_the_operator_link_after_both(tmp_path):
    recorder = (sys.executable, "-c", ENDING.replace("NAME", "recorder"))
    names = ("perception", "recorder", "link")
    ups = [tmp_path / f"{name}.up" for name in names]
    run_service(tmp_path, recorder, lambda _: all(up.exists() for up in ups))
    ended = [int((tmp_path / f"{name}.ended").read_text()) for name in names]
    assert ended == sorted(ended)


@pytest.mark.parametrize("end", ["sys.exit(3)", "os.kill(os.getpid(), 9)"])
def test_a_flight_goes_on_without_its_recorder_and_says_so(tmp_path, end):
    recorder = (sys.executable, "-c", f"import os, sys; {end}")
    ups = [tmp_path / "perception.up", tmp_path / "gate.up"]
    code, lines = run_service(
        tmp_path,
        recorder,
        lambda lines: "recorder" in "".join(lines) and all(up.exists() for up in ups),
    )
    assert sum("nothing more is recorded" in line for line in lines) == 1
    assert not (set(lines) & {line for line in lines if line.startswith("error")})
    assert code == 0  # by the gate's own word
