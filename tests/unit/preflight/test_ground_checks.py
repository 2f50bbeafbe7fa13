"""Each check that needs nothing but this machine, with what makes it fail."""

import dataclasses
import io
import json
import re
from pathlib import Path

import numpy as np
import pytest

from dfvs_core.errors import ConfigError, ModelError
from dfvs_core.gate.checks.preflight import Check
from dfvs_core.gate.config import MS
from dfvs_core.geometry.camera import CameraModel
from dfvs_core.matching.correspondence import FlowField
from dfvs_core.messages.goal import Goal, GoalSidecar, Mount
from dfvs_service.preflight.calibration import camera_check, camera_checks
from dfvs_service.preflight.check import check_camera_and_model
from dfvs_service.preflight.ground import (
    MATCH_BUDGET_NS,
    command_check,
    device_check,
    error_check,
    model_check,
    speed_check,
)
from dfvs_service.preflight.report import CheckReport
from dfvs_service.settings.config import load_config
from dfvs_service.settings.key_file import create_key
from dfvs_service.supervisor.console import shows_colours

CAMERA = CameraModel.from_horizontal_fov(64, 48, 1.2)


def goal(camera=CAMERA):
    return Goal(np.zeros((48, 64, 3), np.uint8), GoalSidecar(camera))


def config(**settings):
    overrides = {name.replace("__", "."): value for name, value in settings.items()}
    return load_config(None, overrides).with_camera((64, 48), GoalSidecar(CAMERA))[0]


def test_the_camera_that_took_the_goal_passes():
    check = camera_check(config(), goal())
    assert check.ok
    assert check.detail == "64 x 48 px, focal length 47 px"


@pytest.mark.parametrize(
    ("name", "factor", "word"),
    [("fx", 1.03, "focal"), ("fy", 0.97, "vertical"), ("cx", 1.05, "x is"), ("cy", 0.95, "y is")],
)
def test_a_goal_of_another_calibration_is_a_cross(name, factor, word):
    other = dataclasses.replace(CAMERA, **{name: getattr(CAMERA, name) * factor})
    check = camera_check(config(), goal(other))
    assert not check.ok
    assert word in check.detail
    assert "calibrate" in check.remedy


def test_a_goal_of_another_distortion_is_a_cross():
    other = dataclasses.replace(CAMERA, distortion=(-0.3, 0.1, 0.0, 0.0))
    assert "the goal's distortion differs" in camera_check(config(), goal(other)).detail


def test_calibrations_of_the_same_camera_may_differ_a_little():
    other = dataclasses.replace(CAMERA, fx=CAMERA.fx * 1.019, cy=CAMERA.cy + 0.9)
    assert camera_check(config(), goal(other)).ok


def test_a_goal_of_another_mounting_is_a_warning_that_names_both():
    taken_level = Goal(goal().image, GoalSidecar(CAMERA))
    check = camera_check(config(**{"camera.mount.pitch_deg": -20}), taken_level)
    assert not check.ok
    assert not check.refuses
    assert "pitch 0.0, yaw 0.0 deg (its sidecar's mount)" in check.detail
    assert "pitch -20.0, yaw 0.0 deg (camera.mount)" in check.detail
    assert "--config" in check.remedy


def test_mountings_of_the_same_camera_may_differ_a_little_and_in_position():
    mount = Mount(x_m=0.2, pitch_rad=np.radians(-20.4))
    taken = Goal(goal().image, GoalSidecar(CAMERA, mount=mount))
    assert camera_check(config(**{"camera.mount.pitch_deg": -20}), taken).ok


def test_every_goal_of_another_camera_has_a_line_that_names_it():
    other = goal(dataclasses.replace(CAMERA, fx=1.1 * CAMERA.fx))
    route = [(Path("a.png"), goal()), (Path("b.png"), other), (Path("c.png"), other)]
    second, third = camera_checks(config(), route)
    assert second.refuses
    assert third.refuses
    assert "b.png" in second.detail
    assert "c.png" in third.detail


def test_goals_of_the_camera_that_flies_have_one_line():
    (check,) = camera_checks(config(), [(Path("a.png"), goal()), (Path("b.png"), goal())])
    assert check.ok


def test_the_classical_matcher_needs_no_files():
    check, matcher = model_check(config(flow__model="classical"))
    assert check.ok
    assert "part of this package" in check.detail
    assert matcher is not None


def test_a_model_whose_file_was_changed_is_a_cross(tmp_path):
    text = {"name": "bad", "kind": "pair"}
    (tmp_path / "manifest.json").write_text(json.dumps(text))
    check, matcher = model_check(config(flow__model=str(tmp_path)))
    assert matcher is None
    assert not check.ok
    assert check.detail
    assert check.remedy


def test_a_folder_without_a_manifest_says_what_was_expected(tmp_path):
    check, _ = model_check(config(flow__model=str(tmp_path)))
    assert check.remedy == "expected all files of a bundle"


@pytest.mark.parametrize(
    ("error", "remedy"),
    [
        (ConfigError("bad"), ""),
        (ConfigError("bad", "good"), "expected good"),
        (ConfigError("bad", "", "repair it"), "repair it"),
    ],
)
def test_the_remedy_of_an_error_has_only_what_the_error_says(error, remedy):
    assert error_check("x", error).remedy == remedy


class Matcher:
    """Takes as long as it is told, on the clock of the test."""

    def __init__(self, *durations_ms):
        self.now_ns, self.durations = 0, list(durations_ms)

    def tick(self):
        return self.now_ns

    def encode(self, image):
        return image

    def match(self, current, wanted, last=None):
        assert last is None
        return self.track(current, wanted, last)

    def track(self, current, wanted, last):
        assert not np.shares_memory(current, wanted)
        self.now_ns += (self.durations.pop(0) if self.durations else 0) * MS
        return FlowField(np.zeros((48, 64, 2), np.float32), np.ones((48, 64), np.float32))


@pytest.mark.parametrize(("then_ms", "ok"), [(20, True), (125, True), (126, False)])
def test_matching_must_leave_time_for_the_frame_before(then_ms, ok):
    assert MATCH_BUDGET_NS == 125 * MS
    matcher = Matcher(900, *[then_ms] * 5)
    check = speed_check(config(), matcher, goal(), matcher.tick)
    assert check.ok is ok
    assert f"first 900 ms, then {then_ms} ms a frame" in check.detail
    assert bool(check.remedy) is not ok


def test_a_model_that_fails_at_work_is_a_cross():
    class Broken(Matcher):
        def match(self, current, wanted, last=None):
            raise ModelError("it gives NaN", "numbers", "use another one")

    matcher = Broken()
    check = speed_check(config(), matcher, goal(), matcher.tick)
    assert (check.ok, check.detail, check.remedy) == (
        False,
        "it gives NaN",
        "expected numbers; use another one",
    )


def test_a_serial_device_that_is_missing_is_named(tmp_path):
    device = tmp_path / "ttyACM0"
    settings = config(vehicle__mavlink=f"serial://{device}:921600")
    check = device_check(settings)
    assert check.detail == f"there is no serial device {device}"
    assert check.refuses
    device.touch()
    assert device_check(settings) is None
    assert device_check(config()) is None


def test_engaging_by_command_needs_a_key_that_is_private(tmp_path):
    assert command_check(config()).ok
    assert not command_check(config(gate__engage="command")).ok
    key = tmp_path / "key"
    signed = config(gate__engage="command", gate__command_key_file=str(key))
    assert "cannot read" in command_check(signed).detail
    create_key(key)
    assert command_check(signed).ok
    key.chmod(0o644)
    assert "0644" in command_check(signed).detail


def test_a_camera_that_does_not_fit_the_goal_leaves_the_vehicle_unchecked():
    problem = ConfigError("the goal has 10 x 10 px", "64 x 48 px", "take another one")
    report = check_camera_and_model(config(), problem)
    found = {check.name: check for check in report.checks}
    assert not report.ok
    assert found["camera"].remedy == "expected 64 x 48 px; take another one"
    assert found["vehicle"].detail == "not checked"


GOOD, BAD = Check("link", True), Check("battery", False, "10% left", "charge it")
ADVICE = Check("zenoh", False, "open", "close it", binding=False)


def test_the_table_says_what_to_do_for_each_cross():
    text = CheckReport("swift", (GOOD, BAD)).to_text()
    assert text.splitlines() == [
        "✓ link",
        "✗ battery  10% left",
        "           → charge it",
        "swift: 1 of 2 checks fail",
    ]
    assert CheckReport("swift", (GOOD,)).to_text().endswith("swift: all checks pass")


@pytest.mark.parametrize(
    ("checks", "ok", "status"),
    [((GOOD,), True, "pass"), ((BAD,), False, "failure"), ((ADVICE,), True, "warning")],
)
def test_a_warning_is_no_failure(checks, ok, status):
    report = CheckReport("swift", checks)
    assert report.ok is ok
    document = json.loads(report.to_json())
    assert document["ok"] is ok
    assert document["checks"][0]["name"] == checks[0].name
    assert document["checks"][0]["status"] == status


def test_what_depends_on_a_failed_check_waits_for_it_and_is_not_ticked():
    lost = Check("link", False, "no heartbeat", "check the cable")
    checks = (lost, Check("battery", False, "unknown"), Check("watch", True), Check("frames", True))
    report = CheckReport("swift", (*checks, Check("goal", True, "overlap 40%")))
    assert report.to_text().splitlines() == [
        "✗ link     no heartbeat",
        "           → check the cable",
        "… battery  waiting for link",
        "… watch    waiting for link",
        "✓ frames",
        "✓ goal     overlap 40%",
        "swift: 1 of 5 checks fail, 2 waiting",
    ]
    assert not report.ok


def test_what_is_not_known_yet_waits_and_is_no_failure():
    report = CheckReport("swift", (GOOD, Check("mounting", True, "not known", pending=True)))
    assert report.to_text().splitlines() == [
        "✓ link",
        "… mounting  not known",
        "swift: all checks pass, 1 waiting",
    ]
    assert report.ok
    assert json.loads(report.to_json())["checks"][1]["status"] == "waiting"


@pytest.mark.parametrize(
    ("is_terminal", "environment", "shown"),
    [
        (True, {}, True),
        (False, {}, False),
        (True, {"NO_COLOR": "1"}, False),
        (True, {"NO_COLOR": ""}, True),
        (True, {"TERM": "dumb"}, False),
    ],
)
def test_colours_are_for_terminals_that_want_them(is_terminal, environment, shown):
    stream = io.StringIO()
    stream.isatty = lambda: is_terminal
    assert shows_colours(stream, environment) is shown


def test_a_coloured_table_has_the_same_words():
    report = CheckReport("swift", (GOOD, BAD, ADVICE))
    coloured = report.to_text(colours=True)
    assert "\x1b[31m✗\x1b[0m battery" in coloured
    assert re.sub(r"\x1b\[\d+m", "", coloured) == report.to_text()
