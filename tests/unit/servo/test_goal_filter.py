"""The filter of goal position, metric scale and odometry error, fed by itself."""

import math
from dataclasses import dataclass, replace

import numpy as np
import pytest
from correlated_errors import correlated

from dfvs_core.geometry.poses import so3_exp
from dfvs_core.servo.goal_filter import (
    ERROR_M_S,
    ERROR_RANGE_M_S,
    ERROR_TIME_S,
    GATE,
    SCALE_SPREAD,
    OdometryDelta,
    PositionMeasurement,
    begin,
    predict,
    restructured,
    update,
)

METRIC = 0.0
DT_S = 1 / 15
DEPTH_M = 3.0
STILL = np.zeros(3)
RATE_ERROR = slice(3, 6)
"""Of the state: true velocity minus the rate of the odometry's position, m/s."""
TURN = np.array([0.0, 0.15, 0.05])
"""Of one frame, rad: a turn in three seconds."""


@dataclass
class Camera:
    """A camera that turns at random, the goal's true position and the filter beside it.

    ``unit_m`` are the metres that a unit of relative depth is.
    """

    rng: np.random.Generator
    goal_m: np.ndarray
    unit_m: float = 1.0
    scale_spread: float = SCALE_SPREAD
    spread: float = 0.0
    estimate: object = None

    def seen(self, noise=STILL):
        """The goal's position as a frame shows it; ``noise`` in standard deviations."""
        exact = PositionMeasurement(
            self.goal_m / self.unit_m, DEPTH_M / self.unit_m, spread=self.spread
        )
        return replace(exact, position=exact.position + exact.noise() * noise)

    def look(self, noise=STILL):
        seen = self.seen(noise)
        if self.estimate is None:
            self.estimate = begin(seen, self.scale_spread)
        else:
            self.estimate = update(self.estimate, seen, DT_S, self.scale_spread)

    def move(self, velocity, error=STILL, told=None, turn=STILL):
        """Move at ``velocity`` for one frame, of which the odometry knows all but ``error``.

        ``turn`` (3,) is the frame's rotation vector. The rotation into the new axes is returned.
        """
        R = so3_exp(np.array(turn))
        rate = velocity - error
        odometry = OdometryDelta(DT_S, rate * DT_S, rate if told is None else told, R)
        self.estimate = predict(self.estimate, odometry, DEPTH_M / self.unit_m)
        self.goal_m = R.T @ (self.goal_m - velocity * DT_S)
        return R.T


def flown_about(seed, seconds=5.0, error_m_s=ERROR_M_S, spread=0.0):
    """A camera that has flown about at random before a goal 2 m away, of unknown scale.

    Half a metre a second, and an odometry error as the model has it.
    """
    rng = np.random.default_rng(seed)
    frames = round(seconds / DT_S)
    errors = correlated(rng, frames, error_m_s, ERROR_TIME_S, DT_S)
    velocities = correlated(rng, frames, 0.3, 2.0, DT_S)
    noise = correlated(rng, frames, 1.0, 0.1, DT_S)
    camera = Camera(rng, np.array([0.3, -0.2, 2.0]), math.exp(rng.normal(0.0, 0.6)), spread=spread)
    turned = np.eye(3)
    for k in range(frames):
        camera.look(noise[k])
        turn = rng.normal(0.0, 0.02, 3)
        turned = camera.move(turned @ velocities[k], turned @ errors[k], turn=turn) @ turned
    return camera


def scale_error(camera):
    """Logarithm of the estimated over the true scale."""
    return math.log(camera.estimate.metres_per_unit / camera.unit_m)


def test_the_scale_is_learnt_within_the_spread_that_is_stated():
    """Over flights with other motions, errors and scales; the spread is neither brash nor shy."""
    flights = [flown_about(seed) for seed in range(60)]
    errors = np.array([scale_error(camera) for camera in flights])
    spreads = np.array([camera.estimate.scale_spread for camera in flights])
    assert np.median(np.abs(errors)) < 0.1
    # Of 60 draws with the stated spread the root mean square lies within 1 +- 0.1 (1 sigma).
    assert 0.6 < np.sqrt(np.mean((errors / spreads) ** 2)) < 1.4
    # Two of them start at a quarter of the scale: so far off, a linearised filter is too sure.
    assert np.sort(np.abs(errors / spreads))[-3] < 2.5
    assert np.abs(errors / spreads).max() < 5.0


def test_a_structure_that_is_hardly_known_says_less_of_the_scale():
    known, guessed = (flown_about(0, spread=spread).estimate for spread in (0.0, 0.5))
    assert guessed.scale_spread > 1.5 * known.scale_spread


@pytest.mark.parametrize("seed", range(5))
def test_a_vehicle_that_drifts_and_believes_to_stand_still_learns_no_scale(seed):
    """The odometry tells of no motion; what the images show is its error, of unknown size."""
    rng = np.random.default_rng(seed)
    camera = Camera(rng, np.array([0.3, -0.2, 1.5]))
    for drift in correlated(rng, 300, 0.04, 3.0, DT_S):
        camera.look()
        camera.move(drift, error=drift)
    assert abs(scale_error(camera)) < 0.05
    assert camera.estimate.scale_spread > 0.55


def test_a_metric_depth_keeps_its_scale():
    camera = Camera(np.random.default_rng(1), np.array([0.0, 0.3, 1.5]), scale_spread=METRIC)
    for _ in range(60):
        camera.look()
        camera.move(np.array([0.0, 0.0, 0.3]), error=np.array([0.0, 0.0, 0.1]))
    assert camera.estimate.metres_per_unit == 1.0
    assert camera.estimate.scale_spread == 0.0


def hovering(error, told=None, seconds=4.0):
    """A camera that stands still by the images, 0.2 m off a goal, whatever the odometry tells."""
    camera = Camera(np.random.default_rng(2), np.array([0.1, 0.1, 0.15]), scale_spread=METRIC)
    for _ in range(round(seconds / DT_S)):
        camera.look()
        camera.move(STILL, error, told)
    return camera.estimate


def test_a_wrong_rate_of_the_position_is_observed_at_a_hover():
    error = np.array([0.05, 0.0, -0.02])
    # An error that is taken to fade with 0.6 s is followed short of its size, by a half here.
    np.testing.assert_allclose(hovering(error).x[RATE_ERROR], error, rtol=0.55)


def test_a_velocity_that_contradicts_the_position_is_observed_at_a_hover():
    """The autopilot controls its velocity estimate: what that is wrong by is flown."""
    told = np.array([0.0, 0.06, 0.0])
    estimate = hovering(STILL, told)
    np.testing.assert_allclose(estimate.velocity_error_m_s, -told, atol=0.002)
    np.testing.assert_allclose(estimate.x[RATE_ERROR], STILL, atol=0.002)


def test_the_expected_size_of_the_error_follows_what_is_seen_of_it():
    small, usual, large = (
        hovering(np.array([size, 0.0, 0.0]), seconds=15.0).error_m_s for size in (0.0, 0.05, 0.3)
    )
    assert ERROR_RANGE_M_S[0] <= small < 0.02 < usual < 0.05 < large
    assert large <= ERROR_RANGE_M_S[1]


def settled(seconds=2.0):
    """A camera that has flown on straight by a right odometry, and its filter."""
    camera = Camera(np.random.default_rng(3), np.array([0.2, 0.0, 2.5]))
    for _ in range(round(seconds / DT_S)):
        camera.look()
        camera.move(np.array([0.0, 0.0, 0.4]))
    return camera


def after_looks_elsewhere(looks):
    """Filter before and after so many measurements half a metre aside."""
    camera = settled()
    before = camera.estimate
    camera.goal_m = camera.goal_m + np.array([0.5, 0.0, 0.0])
    for _ in range(looks):
        camera.look()
    return before, camera.estimate


@pytest.mark.parametrize("looks", [1, 4])
def test_an_outlier_is_passed_over(looks):
    before, after = after_looks_elsewhere(looks)
    np.testing.assert_array_equal(after.x, before.x)
    assert after.outliers == looks


def test_an_outlier_that_stays_is_where_the_goal_is():
    before, after = after_looks_elsewhere(5)
    aside = after.position_m[0] - before.position_m[0]
    assert aside == pytest.approx(0.5 * before.metres_per_unit)
    assert (after.metres_per_unit, after.scale_spread) == (
        before.metres_per_unit,
        before.scale_spread,
    )
    assert (after.outliers, after.restarts - before.restarts) == (0, 1)


def test_a_right_measurement_ends_a_row_of_outliers():
    camera = settled()
    right = camera.goal_m
    for _ in range(3):
        camera.goal_m = right + np.array([0.5, 0.0, 0.0])
        camera.look()
        camera.goal_m = right
        camera.look()
    assert np.linalg.norm(camera.estimate.position_m - right) < 0.1
    assert camera.estimate.outliers == 0


@pytest.mark.parametrize(
    ("nis", "teaches"), [(15.0, True), (17.0, False), (29.0, False), (31.0, False)]
)
def test_a_leap_that_is_hardly_believed_tells_nothing_of_the_scale(nis, teaches, monkeypatch):
    """A wrong match moves the goal where the vehicle does not, as a tiny scale would explain."""
    monkeypatch.setattr("dfvs_core.servo.goal_filter._RELATIVE_NOISE", 0.0)
    camera = settled(0.5)
    before, seen = camera.estimate, camera.seen()
    S = before.P[:3, :3] + np.eye(3) * seen.noise() ** 2
    leap = np.array([0.0, 0.0, -math.sqrt(nis / np.linalg.inv(S)[2, 2])])
    after = update(before, replace(seen, position=before.x[:3] + leap), DT_S, SCALE_SPREAD)
    assert (after.metres_per_unit != before.metres_per_unit) == teaches
    assert (after.scale_spread < before.scale_spread) == teaches
    assert (after.x[2] < before.x[2]) == (nis < GATE)
    assert np.linalg.eigvalsh(after.P)[0] > 0.0


@pytest.mark.parametrize("factor", [0.8, 1.3])
def test_another_structure_is_no_motion_and_leaves_the_distance_while_the_scale_is_open(factor):
    camera = Camera(np.random.default_rng(3), np.array([0.3, -0.2, 2.0]))
    camera.look()
    before = camera.estimate
    after = restructured(before, before.x[:3], factor * before.x[:3], SCALE_SPREAD)
    np.testing.assert_allclose(after.x[:3], factor * before.x[:3])
    assert abs(math.log(after.distance_m / before.distance_m)) < 0.25 * abs(math.log(factor))
    np.testing.assert_array_equal(after.x[RATE_ERROR], before.x[RATE_ERROR])
    assert after.scale_spread > before.scale_spread


@pytest.mark.parametrize("factor", [0.2, 0.5, 2.0, 5.0])
def test_a_known_scale_does_not_follow_a_structure_that_moves_the_goal(factor):
    """That is a wrong match, or the noise of a short distance: the depths are as they were."""
    before = settled().estimate
    after = restructured(before, before.x[:3], factor * before.x[:3], SCALE_SPREAD)
    assert abs(math.log(after.metres_per_unit / before.metres_per_unit)) < 0.1
    assert after.scale_spread < before.scale_spread + 0.1


def test_at_the_goal_another_structure_says_nothing_of_the_scale():
    """There the distance has no size that could be stretched."""
    before = hovering(STILL)
    after = restructured(before, np.array([1e-6, 0.0, 0.0]), np.array([0.0, 1e-2, 0.0]), METRIC)
    assert after is before


def test_a_metric_scale_stays_when_the_structure_changes():
    before = hovering(STILL)
    after = restructured(before, before.x[:3], 0.5 * before.x[:3], METRIC)
    np.testing.assert_allclose(after.x[:3], 0.5 * before.x[:3])
    assert after.metres_per_unit == 1.0
    assert after.scale_spread == 0.0


def test_another_goal_keeps_the_scale_and_the_odometry_s_error():
    old = hovering(np.array([0.05, 0.0, 0.0]))
    elsewhere = PositionMeasurement(np.array([1.0, 2.0, 3.0]), DEPTH_M, 0.0)
    new = begin(elsewhere, METRIC, old)
    np.testing.assert_array_equal(new.x[:3], elsewhere.position)
    np.testing.assert_array_equal(new.x[3:], old.x[3:])
    np.testing.assert_array_equal(new.P[3:, 3:], old.P[3:, 3:])
    np.testing.assert_array_equal(new.velocity_error_m_s, old.velocity_error_m_s)


def test_a_turn_of_the_camera_turns_all_that_is_in_its_axes():
    camera = Camera(np.random.default_rng(4), np.array([0.1, 0.1, 0.15]), scale_spread=METRIC)
    error, slip = np.array([0.05, -0.02, 0.01]), np.array([0.0, 0.04, 0.0])
    turned = np.eye(3)
    for _ in range(90):
        camera.look()
        rate = turned @ -error
        told = rate - turned @ slip
        turned = camera.move(STILL, turned @ error, told, turn=TURN) @ turned
    estimate = camera.estimate
    np.testing.assert_allclose(estimate.position_m, camera.goal_m, atol=0.01)
    np.testing.assert_allclose(estimate.x[RATE_ERROR], turned @ error, atol=0.02)
    np.testing.assert_allclose(
        estimate.velocity_error_m_s - estimate.x[RATE_ERROR], turned @ slip, atol=0.005
    )


def test_without_time_between_two_frames_nothing_changes():
    before = settled().estimate
    odometry = OdometryDelta(0.0, np.ones(3), np.ones(3), np.eye(3))
    assert predict(before, odometry, DEPTH_M) is before


@pytest.mark.parametrize("seed", range(5))
def test_the_covariance_stays_symmetric_and_positive(seed):
    P = flown_about(seed, seconds=20.0).estimate.P
    np.testing.assert_allclose(P, P.T, rtol=1e-9, atol=1e-15)  # rounding of one prediction
    assert np.linalg.eigvalsh(P)[0] > 0.0
