import numpy as np
import pytest

from dfvs_core.messages.link import VehicleState
from dfvs_core.perception.vehicle_history import VehicleHistory

MS = 1_000_000


def state(t_ms, yaw=0.0, velocity=(0.0, 0.0, 0.0), roll=0.0, position=(0.0, 0.0, 0.0)):
    return VehicleState(t_ms * MS, roll, 0.0, yaw, velocity, position)


def filled(states):
    history = VehicleHistory()
    for s in states:
        history.add(s)
    return history


def test_between_two_states_everything_is_interpolated():
    history = filled([state(0, 0.0, roll=0.0), state(100, 0.2, roll=0.1)])
    motion = history.at(25 * MS)
    assert motion.yaw_rad == pytest.approx(0.05)
    assert motion.roll_rad == pytest.approx(0.025)
    assert motion.yaw_rate_rad_s == pytest.approx(2.0)


def test_beyond_the_newest_state_velocity_and_yaw_rate_carry_on_however_close_the_last_two_are():
    forward = (0.5, 0.0, 0.0)
    times_ms = [*range(0, 200, 20), 181]  # the last one comes a millisecond after the one before
    flight = [
        state(t, 0.3e-3 * t, velocity=forward, position=(0.5e-3 * (t // 20 * 20), 0.0, 0.0))
        for t in times_ms
    ]
    motion = filled(flight).at(201 * MS)
    assert motion.yaw_rad == pytest.approx(0.3 * 0.201, abs=1e-3)
    np.testing.assert_allclose(motion.displacement_m, [0.1, 0.0, 0.0], atol=2e-3)
    before = filled(flight).at(-20 * MS)
    np.testing.assert_allclose(before.displacement_m, [-0.01, 0.0, 0.0], atol=2e-3)


def test_yaw_goes_the_short_way_round():
    history = filled([state(0, 3.1), state(100, -3.1)])
    assert history.at(50 * MS).yaw_rad == pytest.approx(np.pi, abs=1e-6)


def displacement(states, t_ms):
    return filled(states).at(t_ms * MS).displacement_m


def test_displacement_follows_the_position_and_not_a_velocity_that_is_wrong():
    """An estimator's velocity may be wrong for seconds while its position is not."""
    wrong = (0.4, 0.0, 0.0)
    flight = [state(20 * i, velocity=wrong, position=(0.0, 0.01 * i, 0.0)) for i in range(51)]
    np.testing.assert_allclose(displacement(flight, 1000), [0.0, 0.5, 0.0], atol=1e-9)


def test_displacement_begins_where_the_history_does():
    away = [state(20 * i, position=(7.0 + 0.01 * i, -3.0, 1.0)) for i in range(11)]
    np.testing.assert_allclose(displacement(away, 200), [0.1, 0.0, 0.0], atol=1e-9)


@pytest.mark.parametrize("reset", [(7.0, 0.0, 0.0), (0.0, 0.0, -0.15)])
def test_a_reset_of_the_position_does_not_show(reset):
    """Across it the velocity tells how far the vehicle went."""
    steady = (0.5, 0.0, 0.0)
    moved = [np.array([0.01 * i, 0.0, 0.0]) + (i > 5) * np.array(reset) for i in range(11)]
    flight = [state(20 * i, velocity=steady, position=tuple(p)) for i, p in enumerate(moved)]
    np.testing.assert_allclose(displacement(flight, 200), [0.1, 0.0, 0.0], atol=1e-9)


def test_a_fast_vehicle_is_not_taken_for_a_reset():
    """Five metres a second over 100 ms: the velocity explains that step."""
    fast = [state(100 * i, velocity=(5, 0, 0), position=(0.52 * i, 0.0, 0.0)) for i in range(4)]
    np.testing.assert_allclose(displacement(fast, 300), [1.56, 0.0, 0.0], atol=1e-9)


def test_level_velocity_is_turned_by_the_heading():
    history = filled([state(0, np.pi / 2, (1.0, 0.0, 0.3)), state(100, np.pi / 2, (1.0, 0.0, 0.3))])
    # Flying north while facing east is flying to the left.
    np.testing.assert_allclose(history.at(50 * MS).level_velocity(), [0, -1, 0.3, 0], atol=1e-9)


def test_a_moment_beyond_the_newest_state_is_carried_on():
    history = [state(0, velocity=(1, 0, 0)), state(100, velocity=(1, 0, 0), position=(0.1, 0, 0))]
    assert displacement(history, 150)[0] == pytest.approx(0.15)


@pytest.mark.parametrize("t_ms", [-500, 1000])
def test_far_away_times_are_unknown(t_ms):
    assert filled([state(0), state(100)]).at(t_ms * MS) is None


def test_a_hole_in_the_telemetry_is_unknown():
    assert filled([state(0), state(2000)]).at(1000 * MS) is None


def test_nothing_is_known_before_two_states():
    assert filled([]).at(0) is None
    assert filled([state(0)]).at(0) is None


def test_states_out_of_order_are_dropped():
    history = filled([state(0), state(100, 0.1), state(50, 9.0)])
    assert history.at(100 * MS).yaw_rad == pytest.approx(0.1)


def test_old_states_are_forgotten():
    history = filled([state(10 * i) for i in range(2000)])
    assert history.at(1000 * MS) is None
    assert history.at(19_000 * MS) is not None
