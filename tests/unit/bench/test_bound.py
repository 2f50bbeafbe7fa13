import numpy as np
import pytest

from dfvs_bench.drone.bound import straight_line_bound, trapezoid_s
from dfvs_core.errors import ConfigError
from dfvs_core.gate.limits import BodyVelocity, VelocityLimits, saturate, slew

LIMITS = VelocityLimits(0.5, 0.3, np.radians(20), 0.5, np.radians(60))


@pytest.mark.parametrize(
    ("way_m", "time_s"),
    [
        (2.0, 5.0),  # 1 s up to 0.5 m/s and 1 s down are 0.5 m, the other 1.5 m take 3 s
        (0.5 + 1e-12, 2.0),  # full speed is just reached
        (0.5, 2.0),
        (0.25, 2**0.5),  # 0.125 m of speeding up at 0.5 m/s² take 0.707 s, and as long to slow down
        (0.0, 0.0),
    ],
)
def test_a_long_way_is_a_trapezoid_and_a_short_one_a_triangle(way_m, time_s):
    assert trapezoid_s(way_m, 0.5, 0.5) == pytest.approx(time_s)


def test_the_slower_of_way_and_turn_decides():
    level = straight_line_bound(np.array([3.0, 4.0, 0.0]), 0.1, LIMITS)
    assert level.least_s == level.way_s == pytest.approx(5.0 / 0.5 + 1.0)
    turn = straight_line_bound(np.array([0.1, 0.0, 0.0]), -np.radians(40), LIMITS)
    assert turn.least_s == turn.turn_s == pytest.approx(2.0 + 1 / 3)


def test_a_steep_way_is_as_slow_as_its_climb():
    climb = straight_line_bound(np.array([0.0, 0.0, -0.9]), 0.0, LIMITS)
    assert climb.way_s == pytest.approx(0.9 / 0.3 + 0.3 / 0.5)
    steep = straight_line_bound(np.array([0.9, 0.0, 0.9]), 0.0, LIMITS)
    # 0.3 m/s down allow 0.3 m/s ahead: 0.424 m/s along the way
    assert steep.way_s == pytest.approx(3.0 + np.hypot(0.3, 0.3) / 0.5)


def test_no_setpoints_within_the_limits_beat_the_bound(rng):
    """Fly straight by the gate's own limits, as fast as they let one, and stop at the goal."""
    dt_s = 0.002
    for _ in range(5):
        displacement = rng.uniform(-1.5, 1.5, 3)
        distance_m = np.linalg.norm(displacement)
        along = displacement / distance_m
        bound = straight_line_bound(displacement, 0.0, LIMITS)
        velocity, flown_m, t_s = BodyVelocity(), 0.0, 0.0
        while flown_m < distance_m - 1e-3:
            room = max(distance_m - flown_m, 0.0)
            wish = min(10.0, np.sqrt(2 * LIMITS.slew_m_s2 * room)) * along
            velocity = slew(velocity, saturate(BodyVelocity(*wish), LIMITS), dt_s, LIMITS)
            flown_m += velocity.speed_m_s * dt_s
            t_s += dt_s
        assert t_s == pytest.approx(bound.way_s, rel=0.03)
        assert t_s >= bound.way_s - 0.1  # a millimetre before the goal it is that much early


@pytest.mark.parametrize("numbers", [(-1.0, 1.0, 1.0), (1.0, 0.0, 1.0), (1.0, 1.0, 0.0)])
def test_limits_that_forbid_all_motion_are_refused(numbers):
    with pytest.raises(ConfigError):
        trapezoid_s(*numbers)
