"""The examples, the notebook and the code of the Python API's page run as they stand."""

import json
import re
import runpy
import shlex
import sys
from pathlib import Path

import cv2
import matplotlib as mpl
import numpy as np
import pytest
from recorded_flight import fly, write_recording
from textured_wall import Wall, texture, turned

ROOT = Path(__file__).parents[2]
PAGE = (ROOT / "docs" / "how-to" / "python.md").read_text()
NOTEBOOK = json.loads((ROOT / "examples" / "first_steps.ipynb").read_text())
MARKDOWN = ["".join(c["source"]) for c in NOTEBOOK["cells"] if c["cell_type"] == "markdown"]
CODE = ["".join(cell["source"]) for cell in NOTEBOOK["cells"] if cell["cell_type"] == "code"]


@pytest.fixture
def folder(tmp_path, monkeypatch, rng):
    """A view, a goal and a recording, in the working folder."""
    monkeypatch.chdir(tmp_path)
    wall = Wall(texture(rng))
    cv2.imwrite("view.png", wall.picture(turned(shift=(20.0, 5.0), zoom=1.1))[:, :, ::-1])
    cv2.imwrite("goal.png", wall.picture()[:, :, ::-1])
    write_recording(tmp_path, fly(rng, frames=8).events).rename("flight.mcap")
    return tmp_path


def run(words, monkeypatch):
    """Exit code of an example."""
    name, *arguments = shlex.split(words)
    path = str(ROOT / "examples" / name)
    monkeypatch.setattr(sys, "argv", [path, *arguments])
    try:
        runpy.run_path(path, run_name="__main__")
    except SystemExit as end:
        return end.code
    return 0


def test_two_images_are_matched_and_drawn(folder, monkeypatch, capsys):
    assert run("match_images.py view.png goal.png --model classical", monkeypatch) == 0
    told = capsys.readouterr().out
    matched = int(re.search(r"(\d+)% of the view is matched", told)[1])
    assert matched > 50
    assert cv2.imread("matches.png").shape == (240, 640, 3)


def test_a_drawing_that_cannot_be_written_is_told(folder, monkeypatch, capsys):
    words = "match_images.py view.png goal.png --model classical --out no-such-folder/matches.png"
    assert run(words, monkeypatch) == 2
    assert "error: cannot write no-such-folder/matches.png" in capsys.readouterr().err


def test_a_free_camera_reaches_the_goal_in_the_room(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    assert run("servo_in_room.py --model classical", monkeypatch) == 0
    last = capsys.readouterr().out.splitlines()[-1]
    assert float(re.search(r"([\d.]+) cm", last)[1]) < 3.0
    assert cv2.imread("servo.png").shape == (240, 960, 3)


def test_a_recording_is_read(folder, monkeypatch, capsys):
    assert run("read_flight.py flight.mcap", monkeypatch) == 0
    told = capsys.readouterr().out
    assert "bottled" in told
    assert "from the goal" in told
    assert re.search(r"[1-9]\d* views, [1-9]\d* with flow", told)


@pytest.mark.parametrize("words", ["match_images.py no.png no.png", "read_flight.py no.mcap"])
def test_bad_input_is_told_in_one_line(words, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    assert run(words, monkeypatch) == 2
    assert "error: cannot read" in capsys.readouterr().err
    assert list(tmp_path.iterdir()) == []


def test_the_notebook_links_to_files_that_are_there():
    links = [link for text in MARKDOWN for link in re.findall(r"\]\(([^)#]+)", text)]
    relative = [link for link in links if "://" not in link]
    assert relative
    for link in relative:
        assert (ROOT / "examples" / link).is_file()


def test_the_code_of_the_page_runs(folder, capsys):
    for code in re.findall(r"```python\n(.*?)```", PAGE, re.DOTALL):
        exec(code, {})
    told = capsys.readouterr().out
    assert "(240, 320, 2)" in told
    assert "Status.OK" in told


def test_the_notebook_holds_no_output_and_runs(monkeypatch, capsys):
    cells = [cell for cell in NOTEBOOK["cells"] if cell["cell_type"] == "code"]
    assert not any(cell["outputs"] or cell["execution_count"] for cell in cells)
    mpl.use("agg")
    monkeypatch.setattr("matplotlib.pyplot.show", lambda: None)
    known = {}
    exec("\n".join(CODE), known)
    assert known["result"].reached
    assert known["distance_m"] < 0.03
    assert np.degrees(known["direction_error_rad"]) < 10.0
    known["plt"].close("all")
