"""Relative pose of two frames in a box-shaped room, from their correspondences."""

from dataclasses import replace

import cv2
import numpy as np
import pytest
from box_room import BoxRoom

from dfvs_core.depth.depth_map import DepthMap
from dfvs_core.geometry.camera import CameraModel
from dfvs_core.geometry.poses import (
    R_BODY_FORWARD_CAMERA,
    invert_pose,
    make_pose,
    rotation_from_euler,
    so3_exp,
    so3_log,
)
from dfvs_core.matching.correspondence import FlowField
from dfvs_core.messages.goal import GoalSidecar, Mount
from dfvs_core.servo.config import ServoConfig
from dfvs_core.servo.exchange import EarlierMatch
from dfvs_core.servo.structure.two_view import _Geometry, _Rays, earlier_view
from dfvs_core.servo.task import ServoTask

CAMERA = CameraModel.from_horizontal_fov(320, 240, np.radians(75))
ROOM = BoxRoom(CAMERA)
TASK = ServoTask(ServoConfig(), CAMERA, GoalSidecar(CAMERA), Mount())
STRIDE = TASK.config.stride_px
NOISE_PX = 0.3
NO_TURN = (0.0, 0.0, 0.0)
GYRO_ERROR = np.radians([0.25, -0.2, 0.15])
"""Of the rotation between two frames: the deviation that the prior expects."""


def camera_pose(position, euler_deg=NO_TURN):
    R = rotation_from_euler(*np.radians(euler_deg)) @ R_BODY_FORWARD_CAMERA
    return make_pose(R, np.array(position, np.float64))


def noisy(flow, seed, noise_px=NOISE_PX):
    """Flow with errors that are alike over 16 px, as those of a network are."""
    cells = (CAMERA.height // 16 + 1, CAMERA.width // 16 + 1, 2)
    noise = np.random.default_rng(seed).normal(0.0, 1.3 * noise_px, cells).astype(np.float32)
    return FlowField(flow.flow + cv2.resize(noise, (CAMERA.width, CAMERA.height)), flow.confidence)


class TwoFrames:
    """Two frames, the camera having gone (3,) m forward, right, down and turned (3,) degrees."""

    def __init__(self, way_m, turn_deg=NO_TURN, seed=0, noise_px=NOISE_PX):
        T_earlier, self.T_current = camera_pose((0, 0, 0)), camera_pose(way_m, turn_deg)
        self.T_earlier_current = invert_pose(T_earlier) @ self.T_current
        self.flow = noisy(ROOM.flow(self.T_current, T_earlier), seed, noise_px)

    def through_a_slit(self):
        """The same frames, of which only the middle is matched."""
        seen = np.zeros_like(self.flow.confidence)
        seen[90:150, 120:200] = self.flow.confidence[90:150, 120:200]
        self.flow = FlowField(self.flow.flow, seen)
        return self

    def depth(self, factor=1.0):
        z = ROOM.depth(self.T_current)[STRIDE // 2 :: STRIDE, STRIDE // 2 :: STRIDE]
        z = (factor * z).astype(np.float32)
        return DepthMap(z, np.ones_like(z))

    def view(self, gyro_error=NO_TURN, odometry_m=None, depth=None):
        """Geometry with a rotation prior and a start of the baseline that may be wrong."""
        T = self.T_earlier_current
        start = T[:3, 3] if odometry_m is None else np.array(odometry_m, np.float64)
        guess = make_pose(so3_exp(np.array(gyro_error)) @ T[:3, :3], start)
        match = EarlierMatch(self.flow, guess)
        return earlier_view(TASK, match, self.depth() if depth is None else depth)

    def rotation_error_deg(self, view):
        R = view.T_earlier_current[:3, :3] @ self.T_earlier_current[:3, :3].T
        return np.degrees(np.linalg.norm(so3_log(R)))

    def direction_error_deg(self, view):
        a, b = view.T_earlier_current[:3, 3], self.T_earlier_current[:3, 3]
        cosine = a @ b / (np.linalg.norm(a) * np.linalg.norm(b))
        return np.degrees(np.arccos(np.clip(cosine, -1.0, 1.0)))

    def length_ratio(self, view):
        found = np.linalg.norm(view.T_earlier_current[:3, 3])
        return found / np.linalg.norm(self.T_earlier_current[:3, 3])


WAYS = [((0.3, 0.0, 0.0), NO_TURN), ((0.0, 0.3, 0.1), (3.0, -2.0, 8.0)), ((-0.2, 0.2, 0), NO_TURN)]
SEEDS = range(5)


@pytest.mark.parametrize(("way_m", "turn_deg"), WAYS)
@pytest.mark.parametrize("seed", SEEDS)
def test_the_images_refine_a_wrong_rotation_and_a_wrong_direction(way_m, turn_deg, seed):
    frames = TwoFrames(way_m, turn_deg, seed)
    start = frames.T_earlier_current[:3, 3] + [0.1, 0.05, -0.05]
    view = frames.view(GYRO_ERROR, start)
    # Errors of 0.3 px, alike over 16 px, are 0.07 degrees over some hundred independent points.
    assert np.degrees(np.linalg.norm(GYRO_ERROR)) > 0.35
    assert frames.rotation_error_deg(view) < 0.25
    assert frames.direction_error_deg(view) < 3.0  # of 20 degrees and more


def test_the_spread_of_the_rotation_is_honest():
    ratios = []
    for way_m, turn_deg in WAYS:
        for seed in SEEDS:
            frames = TwoFrames(way_m, turn_deg, seed)
            gyro_error = np.random.default_rng(seed).normal(0.0, 0.005, 3)
            view = frames.view(gyro_error)
            error_rad = np.radians(frames.rotation_error_deg(view))
            ratios.append(error_rad / view.rotation_spread_rad)
    # The spread is of the worst axis, the error of all three: sqrt(3) at most, if it is right.
    assert 0.3 < np.sqrt(np.mean(np.square(ratios))) < np.sqrt(3.0)


def test_the_length_of_the_odometry_does_not_count():
    frames = TwoFrames((0.0, 0.3, 0.1))
    way = frames.T_earlier_current[:3, 3]
    once, thrice = frames.view(odometry_m=way), frames.view(odometry_m=3.0 * way)
    np.testing.assert_allclose(once.T_earlier_current, thrice.T_earlier_current, atol=1e-9)


@pytest.mark.parametrize("factor", [0.2, 1.0, 4.0])
def test_the_baseline_is_as_long_as_the_known_depth_says(factor):
    """The unit of that depth is arbitrary, and the baseline's is the same."""
    frames = TwoFrames((0.0, 0.3, 0.1))
    view = frames.view(GYRO_ERROR, depth=frames.depth(factor))
    assert frames.length_ratio(view) == pytest.approx(factor, rel=0.05)


def test_a_depth_that_is_a_guess_counts_where_nothing_is_known():
    frames = TwoFrames((0.0, 0.3, 0.0))
    known, wrong = frames.depth(), frames.depth(0.5)
    left = np.zeros(known.z_m.shape, np.bool_)
    left[:, : left.shape[1] // 3] = True
    mixed = DepthMap(np.where(left, known.z_m, wrong.z_m), left.astype(np.float32))
    assert frames.length_ratio(frames.view(depth=mixed)) == pytest.approx(1.0, rel=0.05)
    guess = replace(wrong, validity=np.zeros_like(wrong.validity))
    assert frames.length_ratio(frames.view(depth=guess)) == pytest.approx(0.5, rel=0.1)


@pytest.mark.parametrize("turn_deg", [NO_TURN, (0.0, 0.0, 10.0), (5.0, -5.0, 0.0)])
@pytest.mark.parametrize("seed", SEEDS)
@pytest.mark.parametrize("gyro_error", [NO_TURN, GYRO_ERROR], ids=["right", "wrong"])
def test_a_turn_or_a_standstill_tells_nothing_of_depth(turn_deg, seed, gyro_error):
    """Though the odometry says that the camera has moved by 10 cm."""
    frames = TwoFrames((0.0, 0.0, 0.0), turn_deg, seed)
    assert frames.view(gyro_error, odometry_m=(0.1, 0.02, 0.02)) is None


@pytest.mark.parametrize("noise_px", [1.0, 5.0])
def test_noise_is_no_parallax(noise_px):
    frames = [TwoFrames((0.0, 0.0, 0.0), seed=seed, noise_px=noise_px) for seed in SEEDS]
    assert [f.view(GYRO_ERROR, odometry_m=(0.1, 0.02, 0.02)) for f in frames] == [None] * 5


@pytest.mark.parametrize(("way_m", "tells"), [(0.01, False), (0.06, True)])
def test_a_baseline_must_be_long_against_the_depth(way_m, tells):
    """The room is 4 m deep in the median: 1 cm is 0.25 % of it, 6 cm are 1.5 %."""
    frames = [TwoFrames((0.0, way_m, 0.0), seed=seed) for seed in SEEDS]
    assert [f.view(GYRO_ERROR) is not None for f in frames] == [tells] * 5


@pytest.mark.parametrize("seed", SEEDS)
def test_through_a_slit_the_rotation_is_that_of_the_gyroscopes(seed):
    """There a turn of the camera and a way of it look alike."""
    frames = TwoFrames((0.0, 0.4, 0.0), seed=seed).through_a_slit()
    view = frames.view(GYRO_ERROR)
    gyro_error_deg = np.degrees(np.linalg.norm(GYRO_ERROR))
    assert frames.rotation_error_deg(view) == pytest.approx(gyro_error_deg, abs=0.1)
    assert view.rotation_spread_rad == pytest.approx(0.005, rel=0.02)


@pytest.mark.parametrize(("way_m", "tells"), [(0.05, False), (0.2, True)])
def test_through_a_slit_a_baseline_must_be_longer_than_what_a_turn_may_be_taken_for(way_m, tells):
    """By three deviations of the gyroscopes, 1.5 % of the depth; 5 cm are 1.2 %."""
    frames = [TwoFrames((0.0, way_m, 0.0), seed=seed).through_a_slit() for seed in SEEDS]
    assert [f.view() is not None for f in frames] == [tells] * 5


@pytest.mark.parametrize("seed", SEEDS)
def test_a_quarter_of_wrong_matches_changes_little(seed):
    frames = TwoFrames((0.0, 0.3, 0.1), seed=seed)
    wrong = frames.flow.flow.copy()
    wrong[:, 80:160] += np.random.default_rng(seed).normal(0, 25, (240, 80, 2)).astype(np.float32)
    frames.flow = FlowField(wrong, frames.flow.confidence)
    view = frames.view(GYRO_ERROR)
    assert frames.rotation_error_deg(view) < 0.4  # of the rest alone
    assert frames.direction_error_deg(view) < 4.0
    assert frames.length_ratio(view) == pytest.approx(1.0, rel=0.07)


def test_without_matches_or_a_direction_to_start_from_there_is_no_geometry():
    frames = TwoFrames((0.0, 0.3, 0.1))
    assert frames.view(odometry_m=(0.0, 0.0, 0.0)) is None
    few = np.zeros_like(frames.flow.confidence)
    few[:40, :40] = 1.0  # 25 points of the grid
    frames.flow = FlowField(frames.flow.flow, few)
    assert frames.view() is None


def test_the_slope_of_the_sampson_error_is_that_of_the_error(rng):
    """Its denominator's change counts: by a slope without it other poses seem best."""
    rays = _Rays(*rng.uniform(-0.6, 0.6, (2, 50, 2)), np.ones(50))
    direction = np.array([0.8, 0.1, -0.6])
    geometry = _Geometry(so3_exp(np.array([0.2, -0.3, 0.1])), direction / np.linalg.norm(direction))
    _, slope = geometry.sampson(rays)
    for step, told in zip(1e-6 * np.eye(5), slope, strict=True):
        there, back = (geometry.moved(s).sampson(rays)[0] for s in (step, -step))
        np.testing.assert_allclose(told, (there - back) / 2e-6, rtol=1e-5, atol=1e-7)
