"""What a user reads who asks for something that cannot be, and how a flight is laid out."""

import fcntl
import io
import re
import sys
import tomllib

import cv2
import numpy as np
import pytest

from dfvs_core.geometry.camera import CameraModel
from dfvs_core.messages.goal import GoalSidecar
from dfvs_service import cli
from dfvs_service.settings.config import config_from_json
from dfvs_service.settings.goal_file import load_goals


def save_picture(path, rng, size=(48, 64)):
    cv2.imwrite(str(path), rng.integers(0, 255, (*size, 3), dtype=np.uint8))
    return path


@pytest.fixture
def flights(monkeypatch):
    """Programs, files and goals of flights that end at once with code 1, and bind no ports."""
    begun = []

    def fly(runtime, programs, _display):
        files = {path.name: path.read_bytes() for path in runtime.path.iterdir()}
        begun.append((programs, files, load_goals(runtime)))
        return 1

    monkeypatch.setattr(cli, "fly", fly)
    monkeypatch.setattr(cli, "check_ports", lambda _config: None)
    return begun


@pytest.fixture
def goal(tmp_path, rng, flights):
    """A good goal picture."""
    return save_picture(tmp_path / "goal.png", rng)


FOV = ("--camera-fov", "70")


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["command", "goal", "--key-file", "my.key"], ["--goal IMAGE"]),
        (["command", "hold", "--goal", "GOAL", "--key-file", "my.key"], ["--goal IMAGE"]),
        (["command", "hold", "--key-file", "none"], ["cannot read the key file"]),
        (["flight"], ["no command 'flight'; expected options, or one of config, command,"]),
        (["--goal", "none.png"], ["No such file"]),
        (["--goal", "GOAL"], ["--camera-fov"]),
        (
            ["--goal", "GOAL", *FOV, "--set", "camera.width=640", "--set", "camera.height=480"],
            ["64 x 48", "640 x 480"],
        ),
        (["--goal", "GOAL", "--set", "gate.engaged=auto"], ["did you mean 'engage'"]),
        (
            ["--goal", "GOAL", "--set", "limits.horizontal_m_s=99"],
            ["limits.horizontal_m_s = 99.0 is out of range"],
        ),
        (["--goal", "GOAL", "--config", "nope.toml"], ["nope.toml"]),
        (["--goal", "GOAL", *FOV, "--model", "no-such-model"], ["no-such-model"]),
        (["--goal", "GOAL", *FOV, "--set", "gate.command_key_file=none"], ["new-key"]),
        (["--goal", "GOAL", *FOV, "--engage", "command"], ["command_key_file"]),
        (["--goal", "GOAL", "--image", "check.png"], ["--image without --check"]),
        (["--goal", "GOAL", "--json"], ["--json without --check"]),
        (["--goal", "GOAL", "--check-timeout", "5"], ["--check-timeout without --check"]),
        (["--goal", "GOAL", "--check", "--check-timeout", "inf"], ["--check-timeout is inf"]),
        (["command", "hold", "--key-file", "key", "--timeout", "inf"], ["--timeout is inf"]),
        (["--goal", "GOAL", "--check", "--image", "check.jpg"], ["ends in .png"]),
        (["--goal", "GOAL", "--check", "--image", "no/check.png"], ["lies in no folder"]),
    ],
)
def test_what_cannot_be_is_said_in_one_line(words, said, goal, tmp_path, monkeypatch, refused):
    monkeypatch.chdir(tmp_path)
    line = refused(cli.main, *(goal if word == "GOAL" else word for word in words))
    assert all(part in line for part in said)


@pytest.mark.parametrize("text", ["no JSON", "{}"])
@pytest.mark.parametrize("more", [(), ("--check",)], ids=["flight", "check"])
def test_an_unreadable_sidecar(text, more, goal, refused):
    goal.with_suffix(".json").write_text(text)
    line = refused(cli.main, "--goal", goal, *more)
    assert "goal.json cannot be used" in line
    assert re.search(r"; expected \w", line)


@pytest.mark.parametrize("follows", [False, True], ids=["first goal", "goal of a route"])
def test_a_goal_of_another_lens_than_the_cameras(follows, goal, tmp_path, refused):
    other = tmp_path / "other.png"
    other.write_bytes(goal.read_bytes())
    sidecar = GoalSidecar(CameraModel.from_horizontal_fov(64, 48, 0.9))
    other.with_suffix(".json").write_text(sidecar.to_json())
    line = refused(cli.main, *FOV, "--goal", *([goal, other] if follows else [other]))
    assert "other.png" in line
    assert "the goal's focal length is 66.2 px, here it is 45.7" in line


def test_a_runtime_folder_in_use(goal, tmp_path, refused):
    folder = tmp_path / "run"
    folder.mkdir()
    with (folder / "lock").open("w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        line = refused(cli.main, "--goal", goal, *FOV, "--runtime-dir", folder)
    assert line.startswith(f"error: the runtime folder {folder} is used by another dfvs-service")
    assert f"--runtime-dir {folder}-2" in line


def test_a_full_disk(goal, tmp_path, refused):
    folder = tmp_path / "run"
    folder.mkdir()
    (folder / "config.json").symlink_to("/dev/full")
    words = [*FOV, "--model", "classical", "--runtime-dir", folder]
    assert "No space left on device" in refused(cli.main, "--goal", goal, *words)


def test_an_unknown_option_is_refused_by_name(goal, capsys):
    with pytest.raises(SystemExit) as end:
        cli.main(["--goal", str(goal), "--enagge", "auto"])
    assert end.value.code == 2
    assert "--enagge" in capsys.readouterr().err


def test_printed_settings_are_toml_with_what_was_set(capsys):
    assert cli.main(["config", "--engage", "auto", "--vehicle", "swift"]) == 0
    settings = tomllib.loads(capsys.readouterr().out)
    assert settings["gate"]["engage"] == "auto"
    assert settings["vehicle"]["name"] == "swift"


def test_a_new_key_is_written_once(tmp_path, capfd, refused):
    words = ["command", "new-key", "--key-file", str(tmp_path / "key")]
    assert cli.main(words) == 0
    capfd.readouterr()
    assert "cannot create" in refused(cli.main, *words)


def flown(*words):
    return cli.main([*FOV, "--goal", *map(str, words)])


def test_a_flight_starts_with_everything_laid_out(goal, flights, tmp_path):
    folder = tmp_path / "run"
    assert flown(goal, "--engage", "auto", "--runtime-dir", folder) == 1
    ((_, files, _),) = flights
    assert {"config.json", "goal.png", "goal.json"} <= set(files)
    assert b'"engage": "auto"' in files["config.json"]
    assert folder.stat().st_mode & 0o777 == 0o700


@pytest.fixture
def started(goal, flights, monkeypatch):
    """Starts a flight; gives its programs and settings."""
    monkeypatch.delenv("STATE_DIRECTORY", raising=False)

    def start(*words):
        assert flown(goal, "--model", "classical", *words) == 1
        programs, files, _ = flights[-1]
        return programs, config_from_json(files["config.json"].decode())

    return start


def test_every_flight_has_a_black_box_with_a_folder(started, tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path))
    programs, config = started()
    assert programs.black_box[-1] == "dfvs_service.flights"
    assert config.black_box.folder == str(tmp_path / "dfvs" / "flights")


def test_the_settings_switch_the_black_box_off(started):
    programs, config = started("--set", "black_box.enabled=false")
    assert programs.black_box == ()
    assert not config.black_box.enabled


def test_a_flight_without_any_folder_for_its_records_goes_on(started, monkeypatch, capsys):
    def no_home():
        raise RuntimeError("Could not determine home directory.")

    monkeypatch.delenv("XDG_STATE_HOME", raising=False)
    monkeypatch.setattr("pathlib.Path.home", no_home)
    programs, _ = started()
    assert programs.black_box == ()
    (line,) = capsys.readouterr().err.splitlines()
    assert line.startswith("warning: no black box: ")


@pytest.fixture
def route(tmp_path, rng, flights):
    """Three goal pictures of one size in a folder."""
    folder = tmp_path / "route"
    folder.mkdir()
    for name in ("1.png", "2.png", "3.png"):
        save_picture(folder / name, rng)
    return folder


def test_a_folder_a_list_and_repeated_options_give_the_same_route(route, flights):
    first, *others = sorted(route.iterdir())
    assert flown(route) == 1
    assert flown(first, *others) == 1
    assert flown(first, "--goal", *others) == 1
    goals, *same = [flown_goals for _, _, flown_goals in flights]
    assert len(goals) == 3
    for more in same:
        for a, b in zip(goals, more, strict=True):
            np.testing.assert_array_equal(a.image, b.image)


def test_an_earlier_route_in_a_kept_folder_is_forgotten(route, flights, tmp_path):
    keep = ["--runtime-dir", tmp_path / "run"]
    assert flown(route, *keep) == 1
    assert flown(route / "2.png", *keep) == 1
    assert [len(goals) for _, _, goals in flights] == [3, 1]


def test_every_goal_is_checked_before_anything_starts(route, rng, refused):
    words = [*FOV, "--goal", route]
    save_picture(route / "4.png", rng, (36, 48))
    line = refused(cli.main, *words)
    assert "4.png" in line
    assert "64 x 48" in line
    (route / "4.png").write_bytes(b"no picture")
    assert "4.png" in refused(cli.main, *words)


def test_a_check_looks_at_every_goal_of_a_route(route, rng, capfd, refused):
    words = [*FOV, "--model", "classical", "--check", "--goal", str(route)]
    save_picture(route / "2.png", rng, (36, 48))
    assert cli.main(words) == 1
    (line,) = [line for line in capfd.readouterr().out.splitlines() if line.startswith("✗ camera")]
    assert "2.png" in line
    (route / "3.png").write_bytes(b"no picture")
    assert "3.png" in refused(cli.main, *words)


def test_the_marks_of_a_check_are_named_where_the_encoding_lacks_them(route, rng, monkeypatch):
    printed = io.TextIOWrapper(io.BytesIO(), encoding="iso-8859-1")
    monkeypatch.setattr(sys, "stdout", printed)
    save_picture(route / "2.png", rng, (36, 48))
    assert cli.main([*FOV, "--model", "classical", "--check", "--goal", str(route)]) == 1
    printed.flush()
    assert rb"\N{BALLOT X} camera" in printed.buffer.getvalue()


def test_an_unreadable_goal_picture(goal, refused):
    goal.write_bytes(b"GIF89a")
    assert "PNG or JPEG" in refused(cli.main, "--goal", goal)
