"""The mounting's check: images must turn as the gyroscopes do."""

import numpy as np
import pytest

from dfvs_core.camera import CameraModel
from dfvs_core.depth.source import GoalLink
from dfvs_core.goal import Mount
from dfvs_core.poses import invert_pose, make_pose, rotation_from_euler
from dfvs_core.servo.mounting import MountingState, follow_mounting, mounting_score, seen_cells

CAMERA = CameraModel.from_horizontal_fov(160, 120, np.radians(75))
STRIDE = 8
PERIOD_S = 1.0 / 15.0
DEPTH_M = 3.0
ASSUMED = Mount().T_body_camera()[:3, :3]


def seen_from(T_world_camera, T_world_goal):
    """Cells of the goal view that a camera sees of a wall in front of the goal camera."""
    pixels = CAMERA.grid(STRIDE)
    xy = CAMERA.normalise(pixels)
    rays = np.concatenate([xy, np.ones((*xy.shape[:2], 1))], axis=2)
    T = invert_pose(T_world_goal) @ T_world_camera
    directions = rays @ T[:3, :3].T
    reach = (DEPTH_M - T[2, 3]) / directions[..., 2]
    points = T[:3, 3] + directions * reach[..., None]
    partners = CAMERA.project(points)
    shape = pixels.shape[:2]
    index = np.floor(partners / STRIDE).astype(np.intp)
    inside = ((index >= 0) & (index < [shape[1], shape[0]])).all(axis=2)
    cell = np.where(inside, index[..., 1] * shape[1] + index[..., 0], -1)
    link = GoalLink(cell, CAMERA.normalise(partners), np.eye(4), shape)
    return seen_cells(xy, link)


def score_of(mounted_deg, tilt_deg, velocity=(0.0, 0.0, 0.0), seconds=4.0, noise_deg=0.0):
    """Score after a vehicle rolls and pitches to and fro while it moves."""
    rng = np.random.default_rng(1)
    mounted = Mount(yaw_rad=np.radians(mounted_deg)).T_body_camera()
    T_goal = make_pose(np.eye(3), np.zeros(3)) @ mounted
    state = None
    for k in range(round(seconds / PERIOD_S)):
        t = k * PERIOD_S
        angles = np.radians(tilt_deg) * np.array([np.sin(5.0 * t), np.sin(3.3 * t + 1.0)])
        R = rotation_from_euler(*angles, 0.0)
        T = make_pose(R, np.array(velocity) * t) @ mounted
        measured = angles + np.radians(noise_deg) * rng.normal(size=2)
        now = MountingState(
            round(t * 1e9), rotation_from_euler(*measured, 0.0), seen_from(T, T_goal)
        )
        state = follow_mounting(state, now, ASSUMED)
    return mounting_score(state)


def test_a_camera_that_is_mounted_as_said_is_known_by_its_tilt():
    assert score_of(0.0, tilt_deg=1.0) > 10.0


@pytest.mark.parametrize("mounted_deg", [180.0, 90.0, -90.0, 120.0])
def test_a_camera_that_is_mounted_another_way_round_is_known_too(mounted_deg):
    assert score_of(mounted_deg, tilt_deg=1.0) < -10.0


def test_a_vehicle_that_does_not_tilt_says_nothing():
    for mounted_deg in (0.0, 180.0):
        score = score_of(mounted_deg, tilt_deg=0.0, noise_deg=0.0)
        assert abs(score) < 1.0


def test_motion_does_not_look_like_a_turn():
    assert score_of(0.0, tilt_deg=1.0, velocity=(0.1, 0.1, 0.05)) > 6.0
    assert score_of(180.0, tilt_deg=1.0, velocity=(0.1, -0.1, 0.0)) < -6.0


def test_motion_without_a_tilt_decides_nothing():
    assert abs(score_of(0.0, tilt_deg=0.0, velocity=(0.1, 0.1, 0.0), noise_deg=0.01)) < 5.0


def test_a_few_frames_say_nothing():
    assert score_of(180.0, tilt_deg=1.0, seconds=0.8) is None
    assert mounting_score(None) is None


def test_noise_of_the_attitude_makes_it_less_sure():
    sure, unsure = score_of(0.0, tilt_deg=1.0), score_of(0.0, tilt_deg=1.0, noise_deg=0.3)
    assert 0.0 < unsure < sure


def test_a_gap_between_two_frames_is_passed_over():
    mounted = Mount().T_body_camera()
    first = MountingState(0, np.eye(3), seen_from(mounted, mounted))
    late = MountingState(2 * 10**9, rotation_from_euler(0.3, 0.0, 0.0), first.seen)
    state = follow_mounting(first, late, ASSUMED)
    assert state.weight == 0.0
    assert state.t_ns == late.t_ns
