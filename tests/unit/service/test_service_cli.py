"""What a user reads who asks for something that cannot be: one line, exit code 2, no process."""

import fcntl
import re
import tomllib

import cv2
import numpy as np
import pytest

from dfvs_core.geometry.camera import CameraModel
from dfvs_core.messages.goal import GoalSidecar
from dfvs_service import cli
from dfvs_service.settings.config import config_from_json


@pytest.fixture
def goal(tmp_path, rng, monkeypatch):
    """A good goal picture; nothing may be started, and no port of this machine is asked."""

    def refuse(*_arguments):
        raise AssertionError("a process was to be started")

    monkeypatch.setattr(cli, "fly", refuse)
    monkeypatch.setattr(cli, "check_ports", lambda _config: None)
    path = tmp_path / "goal.png"
    cv2.imwrite(str(path), rng.integers(0, 255, (48, 64, 3), dtype=np.uint8))
    return path


FOV = ("--camera-fov", "70")


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["command", "goal", "--key-file", "my.key"], ["--goal IMAGE"]),
        (["command", "hold", "--goal", "GOAL", "--key-file", "my.key"], ["--goal IMAGE"]),
        (["command", "hold", "--key-file", "none"], ["cannot read the key file"]),
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
        (["--goal", "GOAL", "--check", "--image", "check.jpg"], ["a .png in a folder that"]),
        (["--goal", "GOAL", "--check", "--image", "no/check.png"], ["a .png in a folder that"]),
    ],
)
def test_what_cannot_be_is_said_in_one_line(words, said, goal, tmp_path, monkeypatch, refused):
    monkeypatch.chdir(tmp_path)
    line = refused(cli.main, *(goal if word == "GOAL" else word for word in words))
    assert all(part in line for part in said)


def test_an_unreadable_goal_picture(goal, refused):
    goal.write_bytes(b"GIF89a")
    assert "PNG or JPEG" in refused(cli.main, "--goal", str(goal))


@pytest.mark.parametrize("text", ["no JSON", "{}"])
@pytest.mark.parametrize("more", [(), ("--check",)], ids=["flight", "check"])
def test_an_unreadable_sidecar(text, more, goal, refused):
    goal.with_suffix(".json").write_text(text)
    line = refused(cli.main, "--goal", str(goal), *more)
    assert "goal.json cannot be used" in line
    assert re.search(r"; expected \w", line)


def test_a_goal_of_another_size_than_its_sidecar(goal, refused):
    sidecar = GoalSidecar(CameraModel.from_horizontal_fov(640, 480, 1.2))
    goal.with_suffix(".json").write_text(sidecar.to_json())
    assert "640 x 480" in refused(cli.main, "--goal", str(goal))


@pytest.mark.parametrize("follows", [False, True], ids=["first goal", "goal of a route"])
def test_a_goal_of_another_lens_than_the_cameras(follows, goal, tmp_path, refused):
    other = tmp_path / "other.png"
    other.write_bytes(goal.read_bytes())
    sidecar = GoalSidecar(CameraModel.from_horizontal_fov(64, 48, 0.9))
    other.with_suffix(".json").write_text(sidecar.to_json())
    goals = [goal, other] if follows else [other]
    words = [word for path in goals for word in ("--goal", str(path))]
    line = refused(cli.main, *words, "--camera-fov", "70")
    assert "other.png" in line
    assert "the goal's focal length is 66.2 px, here it is 45.7" in line


def test_a_runtime_folder_in_use(goal, tmp_path, refused):
    folder = tmp_path / "run"
    folder.mkdir()
    with (folder / "lock").open("w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        words = ["--camera-fov", "70", "--runtime-dir", str(folder)]
        assert "is used by another dfvs-service" in refused(cli.main, "--goal", str(goal), *words)


def test_a_full_disk(goal, tmp_path, refused):
    folder = tmp_path / "run"
    folder.mkdir()
    (folder / "config.json").symlink_to("/dev/full")
    words = [*FOV, "--model", "classical", "--runtime-dir", str(folder)]
    assert "No space left on device" in refused(cli.main, "--goal", str(goal), *words)


def test_an_unknown_option_is_refused_by_name(goal, capsys):
    with pytest.raises(SystemExit) as end:
        cli.main(["--goal", str(goal), "--enagge", "auto"])
    assert end.value.code == 2
    assert "--enagge" in capsys.readouterr().err


def test_help_has_an_example(capsys):
    for words in (["--help"], ["config", "--help"], ["command", "--help"]):
        with pytest.raises(SystemExit) as end:
            cli.main(words)
        assert end.value.code == 0
        assert "example" in capsys.readouterr().out


def test_printed_settings_are_toml_with_what_was_set(capsys):
    assert cli.main(["config", "--set", "gate.engage=auto", "--vehicle", "swift"]) == 0
    settings = tomllib.loads(capsys.readouterr().out)
    assert settings["gate"]["engage"] == "auto"
    assert settings["vehicle"]["name"] == "swift"


def test_a_new_key_is_written_once(tmp_path, capfd, refused):
    words = ["command", "new-key", "--key-file", str(tmp_path / "key")]
    assert cli.main(words) == 0
    capfd.readouterr()
    assert "cannot create" in refused(cli.main, *words)


def test_a_flight_starts_with_everything_laid_out(goal, tmp_path, monkeypatch):
    seen = {}

    def fly(runtime, programs, display):
        seen.update({path.name: path.read_bytes() for path in runtime.path.iterdir()})
        return 1

    monkeypatch.setattr(cli, "fly", fly)
    monkeypatch.setattr(cli, "check_ports", lambda _config: None)
    folder = tmp_path / "run"
    words = ["--camera-fov", "70", "--engage", "auto", "--runtime-dir", str(folder)]
    assert cli.main(["--goal", str(goal), *words]) == 1
    assert {"config.json", "goal.png", "goal.json"} <= set(seen)
    assert b'"engage": "auto"' in seen["config.json"]
    assert folder.stat().st_mode & 0o777 == 0o700


@pytest.fixture
def started(goal, monkeypatch):
    """Starts a flight that ends at once; gives its programs and settings."""
    seen = []

    def fly(runtime, programs, _display):
        seen.append((programs, config_from_json(runtime.config.read_text())))
        return 0

    monkeypatch.setattr(cli, "fly", fly)
    monkeypatch.setattr(cli, "check_ports", lambda _config: None)
    monkeypatch.delenv("STATE_DIRECTORY", raising=False)

    def start(*words):
        words = ("--goal", str(goal), "--camera-fov", "70", "--model", "classical", *words)
        assert cli.main(list(words)) == 0
        return seen[-1]

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
