"""What a user reads who asks for something that cannot be: one line, exit code 2, no process."""

import fcntl
import tomllib

import cv2
import numpy as np
import pytest

from dfvs_core.camera import CameraModel
from dfvs_core.goal import GoalSidecar
from dfvs_service import cli
from dfvs_service.config import config_from_json


@pytest.fixture
def goal(tmp_path, rng, monkeypatch):
    """A good goal picture; nothing may be started, and no port of this machine is asked."""

    def refuse(*_arguments):
        raise AssertionError("a process was to be started")

    monkeypatch.setattr(cli, "fly", refuse)
    monkeypatch.setattr(cli, "_check_ports", lambda _config: None)
    path = tmp_path / "goal.png"
    cv2.imwrite(str(path), rng.integers(0, 255, (48, 64, 3), dtype=np.uint8))
    return path


def refused(capsys, *words):
    """The one line that the user reads."""
    assert cli.main(list(words)) == 2
    out, err = capsys.readouterr()
    assert out == ""
    lines = err.splitlines()
    assert len(lines) == 1
    assert lines[0].startswith("error: ")
    return lines[0]


@pytest.mark.parametrize(
    "words", [["goal"], ["hold", "--goal", "goal.png"]], ids=["goal without", "hold with"]
)
def test_an_order_has_a_picture_only_if_it_is_for_a_goal(words, goal, capsys):
    line = refused(capsys, "command", *words, "--key-file", "my.key")
    assert "--goal PICTURE" in line


def test_a_missing_goal_picture(tmp_path, goal, capsys):
    assert "No such file" in refused(capsys, "--goal", str(tmp_path / "none.png"))


def test_an_unreadable_goal_picture(tmp_path, goal, capsys):
    goal.write_bytes(b"GIF89a")
    assert "PNG or JPEG" in refused(capsys, "--goal", str(goal))


def test_a_goal_without_any_word_on_the_lens(goal, capsys):
    assert "--camera-fov" in refused(capsys, "--goal", str(goal))


def test_a_goal_of_another_size_than_the_camera(goal, capsys):
    words = ["--camera-fov", "70", "--set", "camera.width=640", "--set", "camera.height=480"]
    line = refused(capsys, "--goal", str(goal), *words)
    assert "64 x 48" in line
    assert "640 x 480" in line


def test_a_goal_of_another_size_than_its_sidecar(goal, capsys):
    sidecar = GoalSidecar(CameraModel.from_horizontal_fov(640, 480, 1.2))
    goal.with_suffix(".json").write_text(sidecar.to_json())
    assert "640 x 480" in refused(capsys, "--goal", str(goal))


def test_an_unknown_key(goal, capsys):
    line = refused(capsys, "--goal", str(goal), "--set", "gate.engaged=auto")
    assert "did you mean 'engage'" in line


def test_a_bad_value(goal, capsys):
    line = refused(capsys, "--goal", str(goal), "--set", "limits.horizontal_m_s=99")
    assert "limits.horizontal_m_s = 99.0 is out of range" in line


def test_a_missing_settings_file(goal, capsys):
    assert "nope.toml" in refused(capsys, "--goal", str(goal), "--config", "nope.toml")


def test_a_model_that_is_not_there(goal, capsys):
    words = ["--camera-fov", "70", "--model", "no-such-model"]
    assert "no-such-model" in refused(capsys, "--goal", str(goal), *words)


def test_a_key_that_is_not_there(goal, tmp_path, capsys):
    words = ["--camera-fov", "70", "--set", f"gate.command_key_file={tmp_path / 'none'}"]
    assert "new-key" in refused(capsys, "--goal", str(goal), *words)


def test_waiting_for_commands_that_nobody_can_sign(goal, capsys):
    words = ["--camera-fov", "70", "--engage", "command"]
    assert "command_key_file" in refused(capsys, "--goal", str(goal), *words)


@pytest.mark.parametrize("follows", [False, True], ids=["first goal", "goal of a route"])
def test_a_goal_of_another_lens_than_the_cameras(follows, goal, tmp_path, capsys):
    other = tmp_path / "other.png"
    other.write_bytes(goal.read_bytes())
    sidecar = GoalSidecar(CameraModel.from_horizontal_fov(64, 48, 0.9))
    other.with_suffix(".json").write_text(sidecar.to_json())
    goals = [goal, other] if follows else [other]
    words = [word for path in goals for word in ("--goal", str(path))]
    line = refused(capsys, *words, "--camera-fov", "70")
    assert "other.png" in line
    assert "the goal's focal length is 66.2 px, here it is 45.7" in line


def test_a_runtime_folder_in_use(goal, tmp_path, capsys):
    folder = tmp_path / "run"
    folder.mkdir()
    with (folder / "lock").open("w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        words = ["--camera-fov", "70", "--runtime-dir", str(folder)]
        assert "is used by another dfvs-service" in refused(capsys, "--goal", str(goal), *words)


def test_an_order_without_a_key(tmp_path, capsys):
    words = ["command", "hold", "--key-file", str(tmp_path / "none")]
    assert "cannot read the key file" in refused(capsys, *words)


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


def test_a_new_key_is_written_once(tmp_path, capsys):
    words = ["command", "new-key", "--key-file", str(tmp_path / "key")]
    assert cli.main(words) == 0
    capsys.readouterr()
    assert "cannot create" in refused(capsys, *words)


def test_a_flight_starts_with_everything_laid_out(goal, tmp_path, monkeypatch):
    seen = {}

    def fly(runtime, programs, display):
        seen.update({path.name: path.read_bytes() for path in runtime.path.iterdir()})
        return 1

    monkeypatch.setattr(cli, "fly", fly)
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


@pytest.mark.parametrize(
    ("words", "problem"),
    [
        (["--picture", "check.png"], "--picture without --check"),
        (["--check", "--picture", "check.jpg"], "a .png in a folder that can be written"),
        (["--check", "--picture", "nowhere/check.png"], "a .png in a folder that can be written"),
    ],
)
def test_a_picture_of_the_check_that_could_not_be_written(words, problem, goal, capsys):
    assert problem in refused(capsys, "--goal", str(goal), *words)
