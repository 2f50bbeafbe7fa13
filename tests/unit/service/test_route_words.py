"""Several goals on the command line: all of them are checked, and laid out in their order."""

import cv2
import numpy as np
import pytest

from dfvs_service import cli
from dfvs_service.settings.goal_file import load_goals
from dfvs_service.settings.runtime import RuntimeFolder


@pytest.fixture
def route(tmp_path, rng):
    """Three goal pictures of one size in a folder."""
    folder = tmp_path / "route"
    folder.mkdir()
    for name in ("1.png", "2.png", "3.png"):
        picture(folder / name, rng)
    return folder


def picture(path, rng, size=(48, 64)):
    cv2.imwrite(str(path), rng.integers(0, 255, (*size, 3), dtype=np.uint8))


@pytest.fixture
def laid_out(monkeypatch):
    """Goals that the processes would find, in place of a flight that binds ports."""
    seen = []

    def fly(runtime, _programs, _display):
        seen.append([goal.image for goal in load_goals(RuntimeFolder(runtime.path))])
        return 0

    monkeypatch.setattr(cli, "fly", fly)
    monkeypatch.setattr(cli, "check_ports", lambda _config: None)
    return seen


def flown(*words):
    return cli.main(["--camera-fov", "70", "--goal", *map(str, words)])


def test_a_folder_and_a_list_give_the_same_route(route, laid_out):
    assert flown(route) == 0
    assert flown(*sorted(route.iterdir())) == 0
    first, second = laid_out
    assert len(first) == 3
    for a, b in zip(first, second, strict=True):
        np.testing.assert_array_equal(a, b)


def test_an_earlier_route_in_a_kept_folder_is_forgotten(route, laid_out, tmp_path):
    keep = ["--runtime-dir", tmp_path / "run"]
    assert flown(route, *keep) == 0
    assert flown(route / "2.png", *keep) == 0
    assert [len(goals) for goals in laid_out] == [3, 1]


def test_every_goal_is_checked_before_anything_starts(route, laid_out, rng, capsys):
    picture(route / "4.png", rng, (36, 48))
    assert flown(route) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert "4.png" in line
    assert "64 x 48" in line
    (route / "4.png").write_bytes(b"no picture")
    assert flown(route) == 2
    assert "4.png" in capsys.readouterr().err
    assert laid_out == []


def test_an_empty_folder_is_no_route(tmp_path, laid_out, capsys):
    assert flown(tmp_path) == 2
    assert "is empty" in capsys.readouterr().err
