"""The motion monitor: numbers of a frame, and what it remembers of a goal."""

from dataclasses import replace

import numpy as np
import pytest
from box_room import BoxRoom

from dfvs_core.depth.depth_map import DepthMap
from dfvs_core.geometry.camera import CameraModel
from dfvs_core.geometry.poses import make_pose, so3_exp
from dfvs_core.messages.goal import GoalSidecar, Mount
from dfvs_core.servo.checks.motion_monitor import FrameMotion, MotionMonitor
from dfvs_core.servo.config import ServoConfig
from dfvs_core.servo.exchange import Attitude, LastFrame, ServoState
from dfvs_core.servo.goal_filter import FilterModel, PositionMeasurement, begin
from dfvs_core.servo.points import points_from_flow, sample_grid
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
    estimate = replace(begin(seen, FilterModel(scale_spread=0.0)), error_m_s=odometry_error_m_s)
    return FrameMotion(
        k * FRAME_NS, points, points.weight, estimate, AHEAD, 0.3 * AHEAD, is_engaged, is_paused
    )


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
