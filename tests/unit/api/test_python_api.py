"""``import dfvs``: what it offers, its examples, and what it refuses."""

import dataclasses
import doctest
import math
import subprocess
import sys
from importlib import import_module

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from textured_wall import Wall, texture, turned

import dfvs
from dfvs_core.errors import ConfigError, ImageError
from dfvs_core.geometry.poses import make_pose, se3_exp, so3_exp, so3_log
from dfvs_core.matching.relative_pose import relative_pose

CAMERA = dfvs.CameraModel.from_horizontal_fov(320, 240, 1.3)
PERIOD_NS = 100_000_000
MOUNT = dfvs.Mount()
TWICE = np.ones((2, 2, 1), np.uint8)
AT_ONCE = dfvs.ServoConfig(response_s=0.0, yaw_response_s=0.0)
MODULES = {getattr(getattr(dfvs, name), "__module__", "") for name in dfvs.__all__}


@pytest.fixture(scope="module")
def wall():
    return Wall(texture(np.random.default_rng(3)))


@pytest.fixture(scope="module")
def matcher():
    return dfvs.load_matcher("classical")


def test_the_import_loads_no_library():
    code = "import sys, dfvs; print({'numpy', 'cv2', 'onnxruntime', 'mcap'} & set(sys.modules))"
    told = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert told.stdout == "set()\n"


def test_a_name_that_does_not_exist_is_refused():
    with pytest.raises(AttributeError, match="no_such_name"):
        _ = dfvs.no_such_name


@pytest.mark.parametrize("module", sorted(MODULES))
def test_the_examples_of_the_docstrings_hold(module, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert doctest.testmod(import_module(module)).failed == 0


@given(
    turn=st.tuples(*[st.floats(-0.3, 0.3)] * 3),
    aside=st.tuples(*[st.floats(-1.0, 1.0)] * 3).filter(lambda t: np.linalg.norm(t) > 0.3),
)
def test_the_relative_pose_is_that_of_an_exact_flow(turn, aside):
    T = make_pose(so3_exp(np.array(turn)), 0.5 * np.array(aside))
    pixels = CAMERA.grid()
    z = 3.0 + np.sin(pixels[..., 0] / 20.0) + np.cos(pixels[..., 1] / 15.0)
    rays = np.concatenate([CAMERA.normalise(pixels), np.ones((240, 320, 1))], axis=-1)
    points = (rays * z[..., None] - T[:3, 3]) @ T[:3, :3]
    flow = np.asarray(CAMERA.project(points) - pixels, np.float32)
    field = dfvs.FlowField(flow, np.asarray(points[..., 2] > 0.1, np.float32))
    pose = relative_pose(field, CAMERA, CAMERA)
    assert np.linalg.norm(so3_log(pose.R_current_other.T @ T[:3, :3])) < math.radians(0.2)
    assert pose.direction @ T[:3, 3] / np.linalg.norm(T[:3, 3]) > math.cos(math.radians(2.0))
    assert pose.parallax_rad > 0.01


def test_images_that_do_not_match_have_neither_confidence_nor_pose(matcher, wall):
    plain = np.full((240, 320, 3), 120, np.uint8)
    match = dfvs.match_images(matcher, plain, wall.picture(), CAMERA)
    assert match.flow.confidence.max() == 0.0
    assert match.pose is None
    assert match.points()[0].shape == (0, 2)


@pytest.mark.parametrize("mount", [None, dfvs.Mount()], ids=["free camera", "level vehicle"])
def test_the_velocity_leads_to_the_goal(matcher, wall, mount):
    """The view is that of a camera left of the goal: it has to go right."""
    servo = dfvs.Servo(matcher, wall.picture(), CAMERA, mount, AT_ONCE)
    result = servo.step(wall.picture(turned(shift=(20.0, 0.0))), 0)
    assert result.status is dfvs.Status.OK
    assert result.velocity[0 if mount is None else 1] > 0.01
    assert not result.reached


def test_a_vehicle_whose_attitude_is_never_told_is_led_by_the_law_alone(matcher, wall):
    """No mounting can be told from images alone: no motion to the side is asked for."""
    servo = dfvs.Servo(matcher, wall.picture(), CAMERA, MOUNT, AT_ONCE)
    left_px, rising_m_s = 80.0, []
    for k in range(30):
        view = wall.picture(turned(shift=(left_px, 20.0)))
        result = servo.step(view, k * PERIOD_NS)
        assert result.status is dfvs.Status.OK
        assert result.mounting_score is None
        rising_m_s.append(result.velocity[2])
        left_px -= 40.0 * PERIOD_NS * 1e-9 * result.velocity[1]
    assert np.all(np.array(rising_m_s) != 0.0)


def test_without_odometry_the_camera_counts_as_moved_by_its_velocities(matcher, wall):
    """The same numbers come from odometry that says what was commanded."""
    silent = dfvs.Servo(matcher, wall.picture(), CAMERA, config=AT_ONCE)
    told = dfvs.Servo(matcher, wall.picture(), CAMERA, config=AT_ONCE)
    T, velocity = np.eye(4), np.zeros(6)
    for k, left_px in enumerate((12.0, 9.0, 7.0)):
        view = wall.picture(turned(shift=(left_px, 0.0)))
        T = T @ se3_exp(velocity * PERIOD_NS * 1e-9)
        motion = dfvs.Motion.from_pose(T, T[:3, :3] @ velocity[:3])
        expected = told.step(view, k * PERIOD_NS, motion).velocity
        velocity = silent.step(view, k * PERIOD_NS).velocity
        assert velocity == pytest.approx(expected, abs=1e-6)
    assert np.abs(velocity).max() > 0.01


@pytest.mark.parametrize(
    ("attempt", "told"),
    [
        (lambda m, w: dfvs.match_images(m, None, w), "NoneType"),
        (lambda m, w: dfvs.match_images(m, w, np.kron(w, TWICE)), "320 x 240 and 640 x 480 px"),
        (lambda m, w: dfvs.match_images(m, w, w, CAMERA.scaled(640, 480)), "640 x 480"),
        (lambda m, w: dfvs.Servo(m, w[:120], CAMERA), "the goal image has 320 x 120 px"),
        (lambda m, w: dfvs.Servo(m, w, CAMERA).step(w[:, :160], 0), "the frame has 160 x 240 px"),
        (lambda m, w: dfvs.Servo(m, w, CAMERA).step("view.png", 0), "of type str"),
    ],
)
def test_images_that_cannot_be_used_are_refused(attempt, told, matcher, wall):
    with pytest.raises(ImageError, match=told):
        attempt(matcher, wall.picture())


def test_frames_out_of_order_and_odometry_now_and_then_are_refused(matcher, wall):
    servo = dfvs.Servo(matcher, wall.picture(), CAMERA)
    servo.step(wall.picture(), PERIOD_NS)
    with pytest.raises(ConfigError, match="newer"):
        servo.step(wall.picture(), PERIOD_NS)
    with pytest.raises(ConfigError, match="odometry"):
        servo.step(wall.picture(), 2 * PERIOD_NS, dfvs.Motion.at_rest(0.0, 0.0))


@pytest.mark.parametrize("times", [(0.1, 0), (PERIOD_NS, 0.1), (np.float64(PERIOD_NS), 0)])
def test_times_that_are_not_whole_nanoseconds_are_refused(matcher, wall, times):
    t_capture_ns, age_ns = times
    servo = dfvs.Servo(matcher, wall.picture(), CAMERA)
    with pytest.raises(ConfigError, match="nanoseconds"):
        servo.step(wall.picture(), t_capture_ns, age_ns=age_ns)
    assert servo.step(wall.picture(), np.int64(0)).status is dfvs.Status.OK


@pytest.mark.parametrize("mount", [None, dfvs.Mount()], ids=["free camera", "level vehicle"])
@pytest.mark.parametrize("wrong", ["displacement_m", "velocity_m_s", "yaw_rad"])
def test_odometry_that_is_not_finite_is_refused_and_not_remembered(matcher, wall, mount, wrong):
    servo = dfvs.Servo(matcher, wall.picture(), CAMERA, mount)
    rest = dfvs.Motion.at_rest(0.0, 0.0)
    broken = dataclasses.replace(rest, **{wrong: math.nan * getattr(rest, wrong)})
    view = wall.picture(turned(shift=(20.0, 0.0)))
    servo.step(view, 0, rest)
    with pytest.raises(ConfigError, match=wrong):
        servo.step(view, PERIOD_NS, broken)
    assert servo.step(view, PERIOD_NS, rest).status is dfvs.Status.OK


@pytest.mark.parametrize("shapes", [((3, 3), 3), ((4, 4), 2), ((4, 4), (3, 1))])
def test_a_motion_of_other_shapes_is_refused(shapes):
    with pytest.raises(dfvs.DfvsError, match=r"expected \(4, 4\) and \(3,\)"):
        dfvs.Motion.from_pose(*map(np.zeros, shapes))


@pytest.mark.parametrize("depth", ["given", "network"])
def test_a_depth_that_is_not_available_is_refused(depth, matcher, wall):
    with pytest.raises(ConfigError, match=depth):
        dfvs.Servo(matcher, wall.picture(), CAMERA, config=dfvs.ServoConfig(depth=depth))


@pytest.mark.parametrize(
    ("wrong", "told"),
    [
        ({"law": "pse"}, "servo.law = 'pse'; expected one of 'hybrid'"),
        ({"depth": "Motion"}, "servo.depth = 'Motion'; expected one of 'motion'"),
        ({"max_horizontal_m_s": -1.0}, "servo.max_horizontal_m_s = -1.0 is out of range"),
        ({"response_s": math.nan}, "servo.response_s = nan; expected a finite number"),
    ],
)
def test_settings_that_no_settings_file_may_have_are_refused(wrong, told, matcher, wall):
    with pytest.raises(ConfigError, match=told):
        dfvs.Servo(matcher, wall.picture(), CAMERA, config=dfvs.ServoConfig(**wrong))


@pytest.mark.parametrize("names", [(), ("a.mcap", "b"), ("a", "b"), (".",)])
def test_what_holds_no_flight_is_refused(names, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    with pytest.raises(ConfigError, match="flight"):
        dfvs.open_flight(*names)
