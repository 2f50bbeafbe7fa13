"""What the service does with its black box: gives it the last lines, and ends it last."""

import io
import json
import sys

from dfvs_service.settings.runtime import RuntimeFolder
from dfvs_service.supervisor.console import ChangeLines
from dfvs_service.supervisor.parent import Parent, Programs

IDLE = "import time; time.sleep(60)"
CRASHING = """
import json, os, pathlib, socket, sys, time
folder = pathlib.Path(sys.argv[sys.argv.index("--runtime") + 1])
parent = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM)
while not (folder / "box.up").exists():
    beat = {"t_ns": time.monotonic_ns(), "state": "READY", "cause": ""}
    parent.sendto(json.dumps(beat).encode(), str(folder / "parent.sock"))
    time.sleep(0.02)
os.kill(os.getpid(), 9)
"""
READING = """
import pathlib, signal, sys, time
stopped = []
signal.signal(signal.SIGTERM, lambda *_: stopped.append(1))
folder = pathlib.Path(sys.argv[sys.argv.index("--runtime") + 1])
(folder / "box.up").touch()
while not stopped:
    time.sleep(0.01)
(folder / "seen").write_text((folder / "service.jsonl").read_text())
print("warning: the disk is full", file=sys.stderr)
"""


def test_the_black_box_sees_all_that_the_user_was_told_and_the_exit_code(tmp_path):
    gate, perception, box = ((sys.executable, "-c", text) for text in (CRASHING, IDLE, READING))
    stream = io.StringIO()
    programs = Programs(gate, perception, black_box=box)
    code = Parent(RuntimeFolder(tmp_path), programs, ChangeLines(stream)).run()
    assert code == 1
    seen = [json.loads(line) for line in (tmp_path / "seen").read_text().splitlines()]
    told = [record["text"] for record in seen if record["kind"] == "told"]
    assert "error: the gate was killed by SIGKILL; the autopilot's failsafe has the vehicle" in told
    assert (seen[-1]["kind"], seen[-1]["code"]) == ("end", 1)
    # Its own last line reaches the user all the same.
    assert "warning: the disk is full" in stream.getvalue().splitlines()
