"""The relative structure of the goal view while the vehicle flies about before it."""

import numpy as np
import pytest
from box_flight import CAMERA, ROOM, STATE_S, BoxFlight
from box_room import BoxRoom

from dfvs_core.messages.goal import Mount
from dfvs_core.servo.config import ServoConfig

START_M = (-1.0, 0.3, 0.1)
STRIDE = ServoConfig().stride_px


def true_depth_m():
    """Of the goal view's cells (h, w)."""
    return ROOM.depth(Mount().T_body_camera())[STRIDE // 2 :: STRIDE, STRIDE // 2 :: STRIDE]


@pytest.fixture(scope="module")
def learnt():
    """Metres that the unit of the structure truly has, scatter of the cells and scale, by time."""
    flight, true_m, found = BoxFlight(START_M), true_depth_m(), {}
    for k in range(round(24.0 / STATE_S)):
        t_s = k * STATE_S
        flight.step(0.3 * np.cos([0.7 * t_s, 1.1 * t_s + 1.5, 0.9 * t_s]), error=np.zeros(3))
        if k % 300 == 299:
            metres = true_m * flight.state.depth.rho
            unit_m = float(np.median(metres))
            scatter = float(np.median(np.abs(metres / unit_m - 1.0)))
            found[round(t_s)] = unit_m, scatter, flight.state.estimate.metres_per_unit
    return found


def test_the_first_structure_keeps_the_unit_that_the_scale_is_of():
    """From far aside, where little of the goal is seen."""
    flight = BoxFlight((-3.5, 1.5, 0.8))
    while flight.state.depth is None:
        flight.step((0.3, 0.1, 0.0), error=np.zeros(3))
    assert flight.state.estimate.metres_per_unit == pytest.approx(1.0, abs=0.1)
    assert flight.state.estimate.scale_spread == pytest.approx(0.6, abs=0.01)


def test_a_scene_far_beyond_the_guess_of_its_depth_is_learnt():
    """A wall 40 m away is taken for one at 3 m, whose baselines are too short to measure it by."""
    flight = BoxFlight((-6.0, 1.0, 0.3), room=BoxRoom(CAMERA, times=10.0))
    for _ in range(round(8.0 / STATE_S)):
        flight.step((0.45, -0.1, 0.0), error=np.zeros(3))
    assert flight.looks[0].ratio < 0.15
    assert 0.4 < flight.looks[-1].ratio < 1.3


def test_the_unit_does_not_drift_while_measurements_add_up(learnt):
    """Each baseline is measured by the depth that it then improves."""
    units = np.array([unit_m for unit_m, _, _ in learnt.values()])
    assert len(units) == 4
    np.testing.assert_allclose(units, units[0], rtol=0.03)


def test_the_shape_of_the_room_is_learnt(learnt):
    scatters = [scatter for _, scatter, _ in learnt.values()]
    assert scatters[-1] < 0.02
    assert scatters[-1] < scatters[0]


def test_the_metric_scale_is_that_of_the_unit(learnt):
    """By an odometry that is right: to the noise of the measured position, 2 %."""
    for unit_m, _, scale in learnt.values():
        assert scale == pytest.approx(unit_m, rel=0.05)
