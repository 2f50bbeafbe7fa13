"""Perception by the real PX4's odometry: recorded estimates, the true motion seen exactly.

Depth of the room and distance to the goal are known. The settings' first guess of the depth is a
quarter too small here.
"""

import numpy as np
import pytest
from px4_recordings import excerpt, fly

from dfvs_core.servo.exchange import Status

MOVING = ["low_0", "medium_1", "medium_4"]
ALL = [*MOVING, "high_takeoff"]
HOVERS = [
    ("low_0", 0.0, 5.0),
    ("medium_1", 8.5, 99.0),
    ("medium_4", 0.0, 5.0),
    ("high_takeoff", 0.0, 99.0),
]
"""Excerpt, begin and end in s: without a setpoint, or at a goal. Only ``high`` moves much."""
WRONG_SCORE = -5.0
"""Mounting score from which on the gate refuses a mounting."""


def horizontal_rms(values):
    return float(np.sqrt((values[:, :2] ** 2).sum(axis=1).mean()))


def mounting_scores(frames):
    return [s for f in frames if (s := f.result.mounting_score) is not None]


def test_the_excerpts_err_as_the_flights_that_they_are_from():
    """What the other tests stand on; the figures are those of the whole flights."""
    for name, least, most in [
        ("low_0", 0.004, 0.02),
        ("medium_1", 0.02, 0.06),
        ("medium_4", 0.02, 0.06),
        ("high_takeoff", 0.2, 0.6),
    ]:
        flight = excerpt(name)
        assert least < horizontal_rms(flight.told[1] - flight.true[1]) < most


@pytest.mark.parametrize(("name", "since_s", "until_s"), HOVERS)
def test_the_distance_does_not_run_away_at_a_hover(name, since_s, until_s):
    """A velocity estimate that is wrong while the vehicle stands teaches no depth."""
    for frame in fly(name, since_s=since_s):
        if frame.t_s > until_s:
            break
        assert 0.5 < frame.result.error_m / frame.distance_m < 2.0


@pytest.mark.parametrize("name", MOVING)
def test_motion_tells_the_metric_scale(name):
    """To within 30 %; the stated spread has to have narrowed from 60 % to that as well."""
    for frame in fly(name)[-10:]:
        assert 0.7 < frame.result.depth_m / frame.depth_m < 1.3
        assert frame.result.uncertainty.scale < 0.3


@pytest.mark.parametrize("name", MOVING)
@pytest.mark.parametrize("quantity", ["scale", "distance"])
def test_the_stated_spread_is_honest(name, quantity):
    """Within three standard deviations in each frame, and two in most, from the first one on."""
    deviations = []
    for frame in fly(name):
        stated = frame.result.uncertainty
        if quantity == "scale":
            deviations.append(np.log(frame.result.depth_m / frame.depth_m) / stated.scale)
        else:
            deviations.append((frame.result.error_m - frame.distance_m) / stated.error_m)
    assert np.abs(deviations).max() < 3.0
    assert np.mean(np.abs(deviations) < 2.0) > 0.9


@pytest.mark.parametrize("odometry", ["told", "true"])
@pytest.mark.parametrize("name", ALL)
def test_a_right_mounting_is_never_called_wrong(name, odometry):
    assert min(mounting_scores(fly(name, odometry))) > WRONG_SCORE


@pytest.mark.parametrize(
    ("name", "since_s"),
    [("low_0", 5.0), ("medium_1", 0.0), ("medium_4", 4.0), ("high_takeoff", 0.0)],
)
def test_a_backwards_camera_is_called_wrong_once_the_vehicle_tilts(name, since_s):
    """The excerpts tilt by more than 1 degree within these 6 s."""
    scores = mounting_scores(fly(name, "told", np.pi, since_s, since_s + 6.0))
    assert scores[-1] < WRONG_SCORE
    assert max(scores) < -WRONG_SCORE


@pytest.mark.parametrize("name", ALL)
def test_statuses_are_those_of_the_true_odometry(name):
    told, true = fly(name), fly(name, "true")
    assert [f.result.status for f in told] == [f.result.status for f in true]
    assert all(f.result.status is Status.OK for f in told)
