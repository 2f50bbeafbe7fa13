"""What the servo carries on: its estimate to the next frame, and its memory to another goal."""

from dataclasses import replace

import numpy as np
import pytest

from dfvs_core.depth.depth_map import DepthMap
from dfvs_core.geometry.camera import CameraModel
from dfvs_core.matching.correspondence import empty_flow
from dfvs_core.messages.goal import GoalSidecar, Mount
from dfvs_core.servo.config import ServoConfig
from dfvs_core.servo.exchange import Attitude, LastFrame, ServoInputs, ServoState
from dfvs_core.servo.goal_filter import SCALE_SPREAD, PositionMeasurement, begin
from dfvs_core.servo.points import LEAST_POINTS, sample_grid
from dfvs_core.servo.task import ServoTask
from dfvs_core.servo.tracking import predict_goal

CAMERA = CameraModel.from_horizontal_fov(64, 48, 1.3)
TASK = ServoTask(ServoConfig(stride_px=8), CAMERA, GoalSidecar(CAMERA), Mount())
FRAME_S = 0.125
NO_FLOW = empty_flow((48, 64))
ESTIMATE = begin(PositionMeasurement(np.array([0.0, 0.0, 1.0]), 3.0, 0.0), SCALE_SPREAD)


def with_depth(measured):
    """Memory whose depth map has so many measured points of 5 x 10."""
    validity = np.zeros(50, np.float32)
    validity[:measured] = 1.0
    depth_map = DepthMap(np.full((5, 10), 3.0, np.float32), validity.reshape(5, 10))
    return ServoState(depth_map=depth_map, depth_ns=7, estimate=ESTIMATE)


def at_first(forward_m_s, attitude_error_rad=(0.0, 0.0)):
    """Memory after a first frame of a vehicle that flies forward."""
    attitude = Attitude().corrected(attitude_error_rad)
    last = LastFrame(0, attitude, np.array([forward_m_s, 0.0, 0.0, 0.0]), sample_grid(NO_FLOW, 8))
    return replace(with_depth(LEAST_POINTS), last=last, attitude_error_rad=attitude_error_rad)


def carried_on(forward_m_s, moved_m, yaw_rad=0.0, right_m_s=0.0, state=None):
    """Estimate after a frame of a vehicle that flew forward at the first velocity of the two."""
    start, end = forward_m_s
    inputs = ServoInputs(
        now_ns=0,
        t_capture_ns=round(FRAME_S * 1e9),
        flow=NO_FLOW,
        velocity=np.array([end, right_m_s, 0.0, 0.0]),
        attitude=Attitude(yaw_rad=yaw_rad),
        motion_m=(0.0, 0.0, moved_m),
    )
    return predict_goal(TASK, state or at_first(start), inputs)[0]


@pytest.mark.parametrize("forward_m_s", [(0.3, 0.3), (0.3, 0.3625), (0.3, 0.0)])
def test_an_exact_odometry_does_not_slip_while_the_vehicle_accelerates(forward_m_s):
    moved_m = FRAME_S * sum(forward_m_s) / 2
    slip = carried_on(forward_m_s, moved_m).slip_m_s
    np.testing.assert_allclose(slip, 0.0, atol=1e-9)


def test_a_velocity_counts_in_the_axes_of_its_own_frame():
    """North at 0.4 m/s all the time, while the vehicle turns by 2.5 degrees to the right."""
    yaw_rad = np.radians(2.5)
    end = 0.4 * np.cos(yaw_rad), -0.4 * np.sin(yaw_rad)
    slip = carried_on((0.4, end[0]), 0.05, yaw_rad, right_m_s=end[1]).slip_m_s
    np.testing.assert_allclose(slip, 0.0, atol=1e-6)


def test_the_odometry_is_levelled_by_the_attitude_that_was_reported():
    """Level flight stays level, however far the goal's tilt differs from its sidecar's."""
    state = at_first(0.3, attitude_error_rad=(0.02, 0.05))
    for each in (state, state.without_goal()):
        slip = carried_on((0.3, 0.3), FRAME_S * 0.3, state=each).slip_m_s
        np.testing.assert_allclose(slip, 0.0, atol=1e-9)


def test_a_position_that_moves_as_no_velocity_tells_slips():
    slip = carried_on((0.3, 0.3), FRAME_S * 0.35).slip_m_s
    np.testing.assert_allclose(slip, [0.0, 0.0, 0.05], atol=1e-9)


@pytest.mark.parametrize(
    ("measured", "kept"), [(LEAST_POINTS, True), (LEAST_POINTS - 1, False), (0, False)]
)
def test_another_goal_takes_over_the_scale_of_a_measured_depth_alone(measured, kept):
    before = with_depth(measured)
    after = before.without_goal()
    assert (after.estimate is ESTIMATE) == kept
    assert (after.depth_map, after.depth_ns) == (before.depth_map, before.depth_ns)


def test_without_any_depth_there_is_no_scale_to_take_over():
    assert ServoState(estimate=ESTIMATE).without_goal().estimate is None


def test_another_goal_does_not_take_over_a_tilt_error_against_the_former_one():
    assert ServoState(attitude_error_rad=(0.02, 0.05)).without_goal().attitude_error_rad == (0, 0)
