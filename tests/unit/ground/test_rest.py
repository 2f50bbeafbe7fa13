"""Rest by the mean of an estimated velocity that errs as PX4's does."""

import numpy as np
import pytest
from correlated_errors import correlated

from dfvs_sim.ground.rest import RestDetector

RATE_HZ = 50.0
PX4_DEFAULT_NOISE = (0.30, 3.4)
"""Error of PX4's horizontal velocity at its simulation's default noise: m/s rms, s."""


def fed(velocities, down_m=-1.5, target_m=-1.5):
    rest = RestDetector(target_m)
    for k, velocity in enumerate(velocities):
        rest.add(k / RATE_HZ, tuple(velocity), down_m)
    return rest


def steady(speed_m_s, seconds=3.0):
    return np.tile([0.0, speed_m_s, 0.0], (round(seconds * RATE_HZ), 1))


def test_nothing_is_said_before_a_whole_window_was_seen():
    assert not fed(steady(0.0, seconds=1.5)).is_at_rest


@pytest.mark.parametrize("noise_m_s", [0.0, 0.02, 0.2])
def test_a_still_vehicle_is_at_rest_however_its_velocity_jitters(noise_m_s):
    rng = np.random.default_rng(1)
    assert fed(steady(0.0) + noise_m_s * rng.normal(size=(150, 3))).is_at_rest


@pytest.mark.parametrize("speed_m_s", [0.08, 0.3, 1.0])
def test_a_moving_vehicle_is_not_at_rest(speed_m_s):
    rng = np.random.default_rng(2)
    assert not fed(steady(speed_m_s) + 0.02 * rng.normal(size=(150, 3))).is_at_rest


def test_a_vehicle_that_slows_down_is_not_at_rest_yet():
    """Its spread is the slowing down itself: 0.4 to 0.1 m/s within the window."""
    speeds = np.linspace(0.4, 0.1, 101)
    assert not fed(np.outer(speeds, [0.0, 0.0, -1.0])).is_at_rest


def test_rest_at_another_height_is_no_rest():
    assert not fed(steady(0.0), down_m=-0.9).is_at_rest
    assert fed(steady(0.0), down_m=-1.4).is_at_rest
    assert fed(steady(0.0), down_m=-0.9, target_m=None).is_at_rest


def test_an_error_that_outlasts_the_window_may_pass_for_slow_motion():
    """At PX4's default noise hovering looks like 0.2 to 0.5 m/s for seconds."""
    velocities = correlated(np.random.default_rng(3), 1001, *PX4_DEFAULT_NOISE, 1.0 / RATE_HZ)
    velocities *= np.minimum(1.0, 0.5 / np.linalg.norm(velocities, axis=1, keepdims=True))
    assert fed(velocities).is_slow
    assert not fed(steady(1.0)).is_slow


def test_slow_motion_is_that_at_any_height_and_the_height_is_told_apart():
    rest = fed(steady(0.3), down_m=-1.8)
    assert rest.is_slow
    assert not rest.is_at_height
    assert rest.height_error_m == pytest.approx(0.3)
    assert fed(steady(0.3), down_m=-1.4).is_at_height
    assert fed(steady(0.3), down_m=-0.9, target_m=None).is_at_height
