"""The attitude error that the images tell, and what levelling by a wrong attitude does."""

from dataclasses import replace

import cv2
import numpy as np
import pytest
from box_room import BoxRoom

from dfvs_core.depth.depth_map import DepthMap
from dfvs_core.geometry.camera import CameraModel
from dfvs_core.geometry.poses import invert_pose, make_pose, rotation_from_euler
from dfvs_core.matching.correspondence import FlowField
from dfvs_core.messages.goal import GoalSidecar, Mount
from dfvs_core.servo.config import ServoConfig
from dfvs_core.servo.exchange import Attitude
from dfvs_core.servo.level import attitude_error, level_points, real_pose
from dfvs_core.servo.motion import find_goal
from dfvs_core.servo.points import points_from_flow, sample_grid
from dfvs_core.servo.task import ServoTask

CAMERA = CameraModel.from_horizontal_fov(160, 120, np.radians(75))
ROOM = BoxRoom(CAMERA)
NOISE_PX = 0.3
TRUE = Attitude(np.radians(2.0), np.radians(-3.0), np.radians(10.0))
GOAL = np.array([0.5, 0.2, 0.1])
"""Forward, right and down of the vehicle."""
GOAL_TURN_RAD = np.radians(20.0)
"""To the right."""


def task_of(mount):
    return ServoTask(ServoConfig(), CAMERA, GoalSidecar(CAMERA, mount=mount), mount)


class Frames:
    """Frames from one place, the attitude of which is told with an error of (roll, pitch), rad."""

    def __init__(self, error_rad, mount=None, validity=1.0, noise_px=NOISE_PX):
        self.task = task_of(mount or Mount())
        self.rng, self.noise_px, self.error_rad = np.random.default_rng(0), noise_px, error_rad
        T_body_camera = self.task.mount.T_body_camera()
        R = rotation_from_euler(TRUE.roll_rad, TRUE.pitch_rad, TRUE.yaw_rad)
        level = rotation_from_euler(0.0, 0.0, TRUE.yaw_rad)
        goal_level = rotation_from_euler(0.0, 0.0, TRUE.yaw_rad + GOAL_TURN_RAD)
        T_current = make_pose(R, np.zeros(3)) @ T_body_camera
        T_goal = make_pose(goal_level, level @ GOAL) @ T_body_camera
        self.flow = ROOM.flow(T_current, T_goal)
        z = ROOM.depth(T_current)[4::8, 4::8].astype(np.float32)
        self.depth = DepthMap(z, np.full_like(z, validity))
        self.told = replace(
            TRUE, roll_rad=TRUE.roll_rad + error_rad[0], pitch_rad=TRUE.pitch_rad + error_rad[1]
        )

    def fit(self, estimate_rad):
        """Points levelled by the attitude without that error, and the goal by them."""
        noise = self.rng.normal(0.0, 1.3 * self.noise_px, (9, 11, 2)).astype(np.float32)
        flow = FlowField(self.flow.flow + cv2.resize(noise, (160, 120)), self.flow.confidence)
        samples = sample_grid(flow, self.task.config.stride_px)
        points = points_from_flow(samples, self.depth, CAMERA, CAMERA)
        points = level_points(self.task, self.told.corrected(estimate_rad), points)
        points = points.select(points.weight > 0.3)
        pose = find_goal(self.task, points, None)
        return replace(points, weight=pose.weight), pose

    def estimate(self, frames, start_rad=(0.0, 0.0)):
        found = start_rad
        for _ in range(frames):
            found = attitude_error(self.task, *self.fit(found), found)
        return np.array(found)

    def goal_miss_m(self, estimate_rad):
        """By how much the goal's position is off, levelled without that error."""
        _, pose = self.fit(estimate_rad)
        body = self.task.mount.T_body_camera()[:3, :3] @ pose.T_current_goal[:3, 3]
        return np.linalg.norm(body - GOAL)


MOUNTS = pytest.mark.parametrize("mount", [Mount(), Mount(pitch_rad=-0.6)], ids=["ahead", "down"])


@MOUNTS
@pytest.mark.parametrize("error_deg", [(1.0, 0.0), (0.0, 1.0), (1.0, -0.8), (-3.0, 1.0)])
def test_a_wrong_attitude_is_found_by_what_level_motions_leave_unexplained(mount, error_deg):
    frames = Frames(np.radians(error_deg), mount)
    found_deg = np.degrees(frames.estimate(60))
    # The view is small, 160 x 120, and its noise lasts: 0.3 px are 0.15 degrees.
    np.testing.assert_allclose(found_deg, error_deg, atol=0.35)


@MOUNTS
def test_the_goal_is_where_it_is_once_the_attitude_error_is_known(mount):
    error_rad = np.radians([0.5, 1.5])
    frames = Frames(error_rad, mount)
    assert frames.goal_miss_m((0.0, 0.0)) > 0.05  # 1.5 degrees over the 4 m to the wall
    assert frames.goal_miss_m(frames.estimate(60)) < 0.025


@MOUNTS
def test_a_right_attitude_stays_right(mount):
    np.testing.assert_allclose(np.degrees(Frames((0.0, 0.0), mount).estimate(60)), 0.0, atol=0.35)


@pytest.mark.parametrize("validity", [0.0, 0.5])
def test_where_depth_is_not_known_the_estimate_stays_put(validity):
    """A tilt and wrong depths look alike."""
    frames = Frames(np.radians([2.0, 2.0]), validity=validity)
    so_far = (0.011, -0.007)
    assert tuple(frames.estimate(10, so_far)) == so_far


def test_half_of_the_depth_is_not_enough():
    frames = Frames(np.radians([2.0, 2.0]))
    frames.depth.validity[:, :14] = 0.0
    assert tuple(frames.estimate(5)) == (0.0, 0.0)


def test_it_is_enough_that_most_of_the_depth_is_known():
    frames = Frames(np.radians([2.0, 0.0]))
    frames.depth.validity[:, 17:] = 0.0
    assert np.degrees(frames.estimate(60)) == pytest.approx([2.0, 0.0], abs=0.5)


def test_one_frame_changes_the_estimate_by_little():
    frames = Frames(np.radians([3.0, -3.0]))
    assert np.abs(frames.estimate(1)).max() == pytest.approx(0.002)


def test_a_larger_error_is_another_fault_and_not_corrected_away():
    estimate = Frames(np.radians([6.0, 0.0]), Mount(pitch_rad=-0.6)).estimate(90)
    assert estimate[0] == pytest.approx(0.06)


def test_the_real_pose_is_that_between_the_cameras_as_they_are():
    """Of a tilted view and a goal that was taken tilted."""
    sidecar = GoalSidecar(CAMERA, roll_rad=0.05, pitch_rad=-0.1)
    task = replace(task_of(Mount()), goal=sidecar)
    T_body_camera = task.mount.T_body_camera()
    pose = [
        make_pose(rotation_from_euler(*angles), np.array(position)) @ T_body_camera
        for angles, position in [
            ((0.2, -0.1, 0.3), (0.5, 0.2, 0.1)),
            ((0.0, 0.0, 0.3), (0.5, 0.2, 0.1)),
            ((0.05, -0.1, 0.8), (1.0, 0.0, -0.2)),
            ((0.0, 0.0, 0.8), (1.0, 0.0, -0.2)),
        ]
    ]
    current, current_level, goal, goal_level = pose
    T_virtual = invert_pose(current_level) @ goal_level
    found = real_pose(task, Attitude(0.2, -0.1, 0.3), T_virtual)
    np.testing.assert_allclose(found, invert_pose(goal) @ current, atol=1e-9)
