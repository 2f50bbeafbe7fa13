"""Perception by an odometry that errs by 4 cm/s for seconds at a time, as an autopilot's does."""

import numpy as np
import pytest
from box_flight import STATE_S, BoxFlight
from correlated_errors import correlated

SEEDS = range(3)
FAR_M = (-1.2, 0.3, 0.1)
NOWHERE = (0.0, 0.0, 0.0)
OFF_M = 0.07


def lasting(seed, seconds, deviation, time_s):
    """Errors (n, 3) m/s, one for each state of a flight."""
    rng = np.random.default_rng(seed)
    return correlated(rng, round(seconds / STATE_S), deviation, time_s, STATE_S)


def errors(seed, seconds=12.0):
    return lasting(seed, seconds, deviation=0.04, time_s=3.0)


def rate_errors(seed, seconds=12.0):
    """Of the position estimate, which errs less, and for shorter."""
    return lasting(seed + 20, seconds, deviation=0.015, time_s=0.6)


def stretched(flight):
    """Estimated over true distance, in parts of what the first guess of the depth makes of it."""
    ratios = np.array([look.ratio for look in flight.looks])
    return ratios / ratios[0]


@pytest.mark.parametrize("seed", SEEDS)
def test_depth_is_not_learnt_from_a_velocity_error_while_the_vehicle_stands_still(seed):
    """Velocity and position estimate tell of a way, the images of none: that is no baseline."""
    flight = BoxFlight(FAR_M, seed=seed)
    for error, rate_error in zip(errors(seed), rate_errors(seed), strict=True):
        flight.step(NOWHERE, error, rate_error)
    distance = stretched(flight)
    assert 0.7 < np.median(distance) < 2.0
    assert distance.max() < 3.0


def test_a_vehicle_that_stands_for_long_learns_no_scale_however_its_odometry_wanders():
    flight = BoxFlight((-1.5, 0.4, 0.1))
    for error in lasting(0, 20.0, deviation=0.2, time_s=3.0):
        flight.step(NOWHERE, error)
    assert 0.8 < flight.state.estimate.metres_per_unit < 1.25
    assert flight.state.estimate.scale_spread > 0.55


@pytest.mark.parametrize("seed", SEEDS)
def test_depth_is_not_learnt_while_the_vehicle_drifts_and_believes_to_stand_still(seed):
    flight = BoxFlight(FAR_M, seed=seed)
    for error in errors(seed):
        flight.step(-error, error)
    assert stretched(flight).min() > 0.6
    assert stretched(flight).max() < 1.6


@pytest.mark.parametrize("seed", SEEDS)
def test_a_right_mounting_is_never_called_wrong_however_the_odometry_errs(seed):
    """At a hover that sways, when the vehicle begins to move, and while nothing tilts."""
    swaying, departing, at_rest = (BoxFlight(FAR_M, seed=seed) for _ in range(3))
    sway = lasting(seed + 50, 6.0, deviation=0.03, time_s=1.0)
    for k, error in enumerate(errors(seed, 6.0)):
        swaying.step(sway[k], error)
        departing.step((0.1, 0.0, 0.0) if k * STATE_S > 1.0 else NOWHERE, error)
        at_rest.step(NOWHERE, error)
    for flight, at_last in [(swaying, 5.0), (departing, -4.0)]:
        scores = [look.outcome.report.mounting_score for look in flight.looks]
        assert min(score for score in scores if score is not None) > -4.0
        assert scores[-1] > at_last
    assert {look.outcome.report.mounting_score for look in at_rest.looks} == {None}


@pytest.mark.parametrize("axis", [(0.0, 1.0, 0.0), (1.0, 0.0, 0.0)], ids=["aside", "ahead"])
def test_a_goal_7_cm_off_is_not_reached_though_the_odometry_missed_most_of_the_way(axis):
    """It tells a fifth of 40 cm: depth that takes this for the baseline leaps to a fifth."""
    way_m, speed_m_s, axis = 0.4, 0.2, np.array(axis)
    flight = BoxFlight(-(OFF_M + way_m) * axis)
    for k in range(round(8.0 / STATE_S)):
        flies = 1.0 <= k * STATE_S < 1.0 + way_m / speed_m_s
        flight.step(speed_m_s * axis if flies else NOWHERE, error=-0.8 * flight.velocity_m_s)
    assert flight.looks[-1].distance_m == pytest.approx(OFF_M, abs=0.002)
    assert not any(look.outcome.report.reached for look in flight.looks)
