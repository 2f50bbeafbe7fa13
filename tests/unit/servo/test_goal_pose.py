"""Pose of the goal from points whose depth is wrong, and known to be unsure."""

from dataclasses import replace

import numpy as np
import pytest

from dfvs_core.geometry.poses import invert_pose, make_pose, so3_exp, so3_log
from dfvs_core.geometry.robust_weights import NoiseScale
from dfvs_core.servo.freedom import free_camera
from dfvs_core.servo.points import GUESSED_SPREAD, ServoPoints
from dfvs_core.servo.pose import estimate_goal_pose

NOISE = 0.001
T_CURRENT_GOAL = make_pose(so3_exp(np.radians([3.0, 12.0, -2.0])), [0.9, -0.2, 1.4])


def seen(rng, believed=1.0, spread=0.0, count=300):
    """Points of a wall and its furniture in both cameras; ``believed`` times their true depth."""
    z = rng.uniform(4.0, 6.0, count)
    xy = rng.uniform([0.0, -0.5], [0.8, 0.5], (count, 2))
    P = np.column_stack([xy * z[:, None], z])
    T = invert_pose(T_CURRENT_GOAL)
    Q = P @ T[:3, :3].T + T[:3, 3]
    factor = believed(xy) if callable(believed) else believed
    return ServoPoints(xy, Q[:, :2] / Q[:, 2:], z * factor, np.ones(count), np.full(count, spread))


def turn_error_deg(pose):
    R = pose.T_current_goal[:3, :3].T @ T_CURRENT_GOAL[:3, :3]
    return np.degrees(np.linalg.norm(so3_log(R)))


def test_true_depth_gives_the_true_pose():
    pose = estimate_goal_pose(seen(np.random.default_rng(0)), free_camera(), NoiseScale(NOISE))
    assert pose.T_current_goal == pytest.approx(T_CURRENT_GOAL, abs=1e-4)
    assert pose.inlier_share > 0.95


def test_unsure_depth_that_is_right_gives_the_same_pose():
    points = seen(np.random.default_rng(0), spread=GUESSED_SPREAD)
    pose = estimate_goal_pose(points, free_camera(), NoiseScale(NOISE), iterations=40)
    assert pose.T_current_goal == pytest.approx(T_CURRENT_GOAL, abs=1e-3)


@pytest.mark.parametrize("seed", range(5))
def test_a_slope_of_wrong_depth_known_to_be_unsure_turns_nobody(seed):
    points = seen(np.random.default_rng(seed), lambda xy: 0.8 + 0.5 * xy[:, 0])
    believed = turn_error_deg(estimate_goal_pose(points, free_camera(), NoiseScale(NOISE)))
    doubted = replace(points, depth_spread=np.full(len(points.xy), 0.2))
    doubted_pose = estimate_goal_pose(doubted, free_camera(), NoiseScale(NOISE))
    assert turn_error_deg(doubted_pose) < 0.3 * believed
    assert doubted_pose.residual < 3 * NOISE


def test_a_pose_that_passed_the_points_by_is_supported_by_none():
    """Depth that is not known would explain anything behind the goal's camera."""
    points = seen(np.random.default_rng(0), spread=GUESSED_SPREAD)
    beyond = make_pose(T_CURRENT_GOAL[:3, :3], [0.9, -0.2, 30.0])
    fit = estimate_goal_pose(points, free_camera(), NoiseScale(NOISE), beyond, iterations=0)
    assert fit.support == 0.0


def test_matches_off_the_epipolar_lines_stay_unexplained():
    points = seen(np.random.default_rng(1), spread=GUESSED_SPREAD)
    rng = np.random.default_rng(2)
    scattered = replace(points, xy_goal=rng.uniform(-0.8, 0.8, points.xy_goal.shape))
    assert estimate_goal_pose(scattered, free_camera(), NoiseScale(NOISE)).residual > 50 * NOISE
