"""Correspondences of which a part, lying together, was matched with another place."""

from dataclasses import replace

import numpy as np
import pytest
from still_pipeline import StillMatcher

from dfvs_core.geometry.camera import CameraModel
from dfvs_core.geometry.poses import invert_pose, make_pose, pose_error, so3_exp
from dfvs_core.geometry.robust_weights import NoiseScale
from dfvs_core.matching.correspondence import FlowField
from dfvs_core.messages.frame import Frame
from dfvs_core.messages.goal import Goal, GoalSidecar, Mount
from dfvs_core.perception.pipeline import Pipeline
from dfvs_core.perception.vehicle_history import Motion
from dfvs_core.servo.config import ServoConfig
from dfvs_core.servo.exchange import ServoInputs, ServoState, Status
from dfvs_core.servo.motion import find_goal, is_clear
from dfvs_core.servo.points import ServoPoints, without_cells
from dfvs_core.servo.pose import estimate_goal_pose
from dfvs_core.servo.step import servo_step
from dfvs_core.servo.task import ServoTask

CAMERA = CameraModel.from_horizontal_fov(320, 240, 1.5)
TASK = ServoTask(ServoConfig(), CAMERA, GoalSidecar(CAMERA), Mount())
NOISE = NoiseScale(TASK.config.flow_noise_px / CAMERA.fx)
T_CURRENT_GOAL = make_pose(so3_exp(np.array([0.0, 0.25, 0.0])), np.array([0.8, -0.1, 1.2]))
"""Level, as the goal of a level body is."""
ELSEWHERE = np.array([0.05, 0.05])


def wrong_share(rng, share):
    """Points in both views, of unknown depth, the lowest ``share`` of which leads elsewhere.

    That is where it would be seen if it moved about as the others do: a floor taken for a wall.
    """
    z = rng.uniform(3.0, 6.0, 400)
    xy = rng.uniform([-0.6, -0.5], [0.6, 0.5], (400, 2))
    P = np.column_stack([xy * z[:, None], z])
    T = invert_pose(T_CURRENT_GOAL)
    Q = P @ T[:3, :3].T + T[:3, 3]
    xy_goal = Q[:, :2] / Q[:, 2:] + rng.normal(0.0, NOISE.least, (400, 2))
    wrong = xy[:, 1] > np.quantile(xy[:, 1], 1.0 - share)
    shift = np.median((xy_goal - xy)[~wrong], axis=0) + ELSEWHERE
    xy_goal[wrong] = xy[wrong] + shift + rng.normal(0.0, 0.01, (wrong.sum(), 2))
    return ServoPoints(xy, xy_goal, np.full(400, 4.0), np.ones(400), np.full(400, 0.5)), wrong


def turn_deg(pose):
    return np.degrees(pose_error(pose.T_current_goal, T_CURRENT_GOAL)[1])


@pytest.mark.parametrize("seed", range(8))
def test_the_goal_is_found_by_those_that_agree_on_it(seed):
    points, wrong = wrong_share(np.random.default_rng(seed), 0.44)
    assert turn_deg(estimate_goal_pose(points, TASK.basis, NOISE)) > 5.0  # a compromise
    found = find_goal(TASK, points, None)
    assert turn_deg(found) < 0.3
    assert is_clear(TASK, found)
    assert np.mean(found.weight[wrong] > 0.0) < 0.02
    assert np.mean(found.weight[~wrong] > 0.0) > 0.95


def test_the_pose_of_the_frame_before_counts_only_if_it_explains_more():
    points, _ = wrong_share(np.random.default_rng(0), 0.2)
    astray = T_CURRENT_GOAL @ make_pose(np.eye(3), np.array([3.0, 0.0, 0.0]))
    for T_guess in (T_CURRENT_GOAL, astray):
        assert turn_deg(find_goal(TASK, points, T_guess)) < 0.3


def test_where_the_pose_of_the_frame_before_is_clear_the_halves_are_not_asked(monkeypatch):
    points, _ = wrong_share(np.random.default_rng(0), 0.44)
    monkeypatch.setattr("dfvs_core.servo.motion._halves", lambda _: pytest.fail("were asked"))
    assert turn_deg(find_goal(TASK, points, T_CURRENT_GOAL)) < 0.3


def test_what_agrees_on_nothing_is_not_clear(rng):
    points, _ = wrong_share(rng, 0.0)
    scattered = replace(points, xy_goal=rng.uniform(-0.6, 0.6, points.xy_goal.shape))
    assert not is_clear(TASK, find_goal(TASK, scattered, None))


def flow_of_a_wall(share):
    """Flow to a goal 1 m to the right before a wall at 4 m; ``share`` of it, below, is wrong."""
    shift_px = -CAMERA.fx * 1.0 / 4.0
    flow = np.zeros((240, 320, 2), np.float32)
    flow[..., 0] = shift_px
    wrong = np.zeros((240, 320), np.bool_)
    wrong[round(240 * (1.0 - share)) :] = True
    flow[wrong] = np.float32([40.0, -30.0])
    return FlowField(flow, np.ones((240, 320), np.float32)), wrong


def step(flow):
    inputs = ServoInputs(now_ns=0, t_capture_ns=0, flow=flow, velocity=np.zeros(4))
    return servo_step(TASK, ServoState(), inputs)


def test_a_step_tells_which_points_of_its_grid_are_out_of_line():
    flow, wrong = flow_of_a_wall(0.4)
    result, state = step(flow)
    assert result.status is Status.OK
    left = without_cells(flow, state.outliers, TASK.config.stride_px)
    inside = slice(80, 272)  # elsewhere the flow leads out of the goal picture
    assert not (left.confidence[:, inside] > 0)[wrong[:, inside]].any()
    assert np.mean(left.confidence[~wrong] > 0) > 0.95


def test_what_is_out_of_line_is_not_tracked_on(rng):
    flow, wrong = flow_of_a_wall(0.4)
    matcher, picture = StillMatcher(flow), rng.integers(0, 255, (240, 320, 3)).astype(np.uint8)
    pipeline = Pipeline(TASK, matcher, Goal(picture, TASK.goal), lambda: 0)
    for k in range(2):
        pipeline.process_frame(Frame(picture, k, k), Motion.at_rest(0.0, 0.0), engaged=False)
    (predicted,) = matcher.predictions
    assert not predicted.confidence[:, 80:272][wrong[:, 80:272]].any()
    assert np.mean(predicted.confidence[~wrong] > 0) > 0.95


def test_a_step_that_explains_nothing_names_no_outliers(rng):
    flow, _ = flow_of_a_wall(0.0)
    noise = rng.uniform(-60.0, 60.0, flow.flow.shape).astype(np.float32)
    _, state = step(FlowField(flow.flow + noise, flow.confidence))
    assert not state.outliers.any()


def test_cells_taken_out_of_a_picture_that_is_no_multiple_of_them():
    field = FlowField(np.zeros((13, 18, 2), np.float32), np.ones((13, 18), np.float32))
    cells = np.zeros((2, 2), np.bool_)  # of a stride of 8 px: at 4 and 12 px
    cells[1, 1] = True
    left = without_cells(field, cells, 8).confidence
    assert not left[8:, 8:16].any()
    assert left.sum() == 13 * 18 - 5 * 8
