"""The motion monitor: numbers of a frame, and what it remembers of a goal."""

from dataclasses import replace

import numpy as np
import pytest
from box_room import BoxRoom

from dfvs_core.depth.depth_map import DepthMap
from dfvs_core.geometry.camera import CameraModel
from dfvs_core.geometry.poses import make_pose, rotation_from_euler, so3_exp
from dfvs_core.matching.correspondence import empty_flow
from dfvs_core.messages.goal import GoalSidecar, Mount
from dfvs_core.servo.checks.image_turn import ImageTurn
from dfvs_core.servo.checks.motion_monitor import FrameMotion, MotionMonitor
from dfvs_core.servo.checks.mounting import begin_mounting, follow_mounting, mounting_score
from dfvs_core.servo.config import ServoConfig
from dfvs_core.servo.exchange import Attitude, LastFrame, ServoInputs, ServoState
from dfvs_core.servo.goal_filter import PositionMeasurement, begin
from dfvs_core.servo.points import points_from_flow, sample_grid
from dfvs_core.servo.step import _probed
from dfvs_core.servo.task import ServoTask

CAMERA = CameraModel.from_horizontal_fov(160, 120, np.radians(75))
ROOM = BoxRoom(CAMERA)
TASK = ServoTask(ServoConfig(progress_s=2.0), CAMERA, GoalSidecar(CAMERA), Mount())
AHEAD = np.array([1.0, 0.0, 0.0, 0.0])
FRAME_NS = 100_000_000


def frame(k, odometry_error_m_s=0.0, is_engaged=True, is_paused=False):
    """The k-th frame of a vehicle that stands 1 m before the goal and is told to fly there."""
    T = Mount().T_body_camera()
    T_goal = T.copy()
    T_goal[0, 3] += 1.0
    samples = sample_grid(ROOM.flow(T, T_goal), TASK.config.stride_px)
    depth = DepthMap(np.full(samples.confidence.shape, 3.0), np.ones(samples.confidence.shape))
    points = points_from_flow(samples, depth, CAMERA, CAMERA)
    seen = PositionMeasurement(np.array([0.0, 0.0, 1.0]), 3.0, 0.0)
    estimate = replace(begin(seen, 0.0), error_m_s=odometry_error_m_s)
    return FrameMotion(
        k * FRAME_NS, points, points.weight, estimate, AHEAD, 0.3 * AHEAD, is_engaged, is_paused
    )


def follow(state, tilts_rad, seed=0):
    """Regression after tilts (n, 2), 100 ms apart, by gyroscopes and images with noise."""
    rng, covariance = np.random.default_rng(seed), 4e-4**2 * np.eye(3)
    R_body_camera = Mount().T_body_camera()[:3, :3]
    for angles, before in zip(tilts_rad[1:], tilts_rad, strict=False):
        tilt = 1e-4 * rng.normal(size=2) + angles
        now = begin_mounting(state.t_ns + FRAME_NS, rotation_from_euler(*tilt, 0.0))
        turn_rad = np.append(angles - before, 0.0) + 4e-4 * rng.normal(size=3)
        state = follow_mounting(
            state, now, ImageTurn(R_body_camera.T @ turn_rad, covariance), R_body_camera
        )
    return state


def right_mounting():
    """Regression of a right mounting that has just been told, and the same after 10 s at rest."""
    t = 0.1 * np.arange(30)
    tilts = 0.004 * np.stack([np.sin(5.0 * t), np.sin(3.3 * t)], axis=1)
    told = follow(begin_mounting(0, np.eye(3)), tilts)
    return told, follow(told, np.zeros((100, 2)), seed=1)


def asked_aside(state, k, engaged=True):
    """Share of 20 frames in which a vehicle 1 m before the goal is asked aside, and the state."""
    count = 0
    for j in range(k, k + 20):
        measures, monitor = state.measure(TASK, frame(j, is_engaged=engaged))
        inputs = ServoInputs(j * FRAME_NS, j * FRAME_NS, empty_flow((1, 1)), np.zeros(4))
        asked = _probed(TASK, inputs, measures, 0.3 * AHEAD, frame(j).estimate)
        count += asked[1] != 0.0
        state = monitor
    return count / 20, state


def test_a_mounting_that_has_passed_in_flight_is_not_probed_again():
    told, faded = right_mounting()
    assert mounting_score(told) > 7.0
    assert mounting_score(faded) == 0.0  # undecided
    share, monitor = asked_aside(MotionMonitor(told), 0)
    assert share == 0.0
    for later in (monitor, monitor.without_goal()):
        assert asked_aside(replace(later, mounting=faded), 120)[0] == 0.0


def test_a_mounting_that_passed_before_the_flight_alone_is_probed_in_flight():
    """The gate asks for the score in flight."""
    told, faded = right_mounting()
    _, monitor = asked_aside(MotionMonitor(told), 0, engaged=False)
    assert asked_aside(replace(monitor, mounting=faded), 120)[0] == 0.75


def test_a_mounting_that_passed_is_probed_in_another_engagement_as_the_gate_asks_for_it_anew():
    told, faded = right_mounting()
    _, monitor = asked_aside(MotionMonitor(told), 0)
    _, monitor = monitor.measure(TASK, frame(30, is_engaged=False, is_paused=True))
    assert monitor.has_mounting_passed
    _, monitor = monitor.measure(TASK, frame(31, is_engaged=False))
    assert asked_aside(replace(monitor, mounting=faded), 120)[0] == 0.75


def watched(frames):
    monitor, measures = MotionMonitor(), None
    for each in frames:
        measures, monitor = monitor.measure(TASK, each)
    return measures, monitor


def test_an_error_that_does_not_fall_is_stuck():
    assert not watched(frame(k) for k in range(15))[0].is_stuck
    assert watched(frame(k) for k in range(40))[0].is_stuck


def test_no_progress_is_asked_for_against_an_odometry_error_as_large_as_the_speed():
    assert not watched(frame(k, odometry_error_m_s=0.2) for k in range(40))[0].is_stuck


def test_no_progress_is_asked_for_while_the_vehicle_does_not_follow():
    assert not watched(frame(k, is_engaged=False) for k in range(40))[0].is_stuck


def test_a_hold_does_not_begin_the_time_without_progress_anew():
    flown = [frame(k) for k in range(15)]
    held = [frame(k, is_engaged=False, is_paused=True) for k in range(15, 30)]
    assert not watched(flown + held)[0].is_stuck
    assert watched(flown + held + [frame(k) for k in range(30, 40)])[0].is_stuck


def test_the_mean_error_is_told_in_metres():
    measures, _ = watched(frame(k) for k in range(12))
    assert measures.mean_error_m == pytest.approx(1.0)
    assert measures.spread_m == pytest.approx(0.0, abs=1e-9)
    assert measures.median_error_px == pytest.approx(measures.feature_error * CAMERA.fx, rel=0.05)


def test_another_goal_begins_without_errors_and_progress():
    _, monitor = watched(frame(k) for k in range(40))
    assert monitor.without_goal() == MotionMonitor(monitor.mounting)


def test_the_turn_between_two_goal_images_is_no_turn_of_the_camera():
    """The first flow to another goal is not compared with the last one to the former."""
    T = Mount().T_body_camera()
    T_goal, T_next = T.copy(), T @ make_pose(so3_exp(np.array([0.1, 0.0, 0.0])), np.zeros(3))
    T_goal[0, 3] += 1.0
    flows = [sample_grid(ROOM.flow(T, to), TASK.config.stride_px) for to in (T_goal, T_next)]
    depth = DepthMap(np.full(flows[0].confidence.shape, 3.0), np.ones(flows[0].confidence.shape))
    monitor = MotionMonitor().follow_tilt(TASK, 0, np.eye(3), (None, flows[0]), depth)
    state = ServoState(
        monitor=monitor, last=LastFrame(0, Attitude(0.0, 0.0, 0.0), np.zeros(4), flows[0])
    )
    turned = so3_exp(np.array([0.0, 0.01, 0.0]))

    def after(state):
        last = (state.last.samples, flows[1])
        return state.monitor.follow_tilt(TASK, FRAME_NS, turned, last, depth).mounting.information

    assert not after(state.without_goal()).any()
    assert after(state).any()
