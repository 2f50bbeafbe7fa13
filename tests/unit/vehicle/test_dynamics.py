"""The vehicle moves as PX4 v1.17's own quadrotor model was recorded to move."""

import math
from functools import cache

import numpy as np
import pytest
from numpy.typing import NDArray

from dfvs_sim.dynamics.control import Controller, Demand
from dfvs_sim.dynamics.estimate_errors import EstimateErrors
from dfvs_sim.dynamics.estimator import Estimate, Estimator
from dfvs_sim.dynamics.rigid_body import GRAVITY_M_S2, TILT_MAX_RAD, Command, Quadrotor

DT_S = 0.004
STEP_S = 6.0
"""How long each step is held before the stop."""

TIMES_S = (0.2, 0.4, 0.6, 0.8, 1.0, 1.5, 2.0, 3.0, 4.0, 4.8)
RECORDED = {
    ("forward", "step"): (0.076, 0.299, 0.515, 0.623, 0.675, 0.762, 0.788, 0.828, 0.845, 0.868),
    ("forward", "stop"): (0.806, 0.604, 0.399, 0.289, 0.227, 0.158, 0.146, 0.101, 0.109, 0.085),
    ("up", "step"): (0.231, 0.395, 0.446, 0.477, 0.472, 0.479, 0.474, 0.484, 0.485, 0.496),
    ("up", "stop"): (0.274, 0.100, 0.054, 0.041, 0.047, 0.024, 0.014, 0.018, 0.015, 0.007),
    ("yaw", "step"): (0.152, 0.332, 0.442, 0.498, 0.523, 0.540, 0.535, 0.523, 0.512, 0.506),
    ("yaw", "stop"): (0.351, 0.175, 0.062, 0.005, -0.022, -0.037, -0.032, -0.021, -0.013, -0.008),
}
"""Speed (m/s, rad/s) at TIMES_S after the step to 1 m/s, 0.5 m/s or 0.5 rad/s and after the stop,
locally smoothed, from one run; the runs differ by some 0.03 and the signal jitters by 0.02."""

SIZES = {"forward": 1.0, "up": 0.5, "yaw": 0.5}
"""The steps, m/s and rad/s."""


@cache
def response(axis: str) -> NDArray[np.float64]:
    """Speed along the axis every 4 ms, from the step's first moment on; then the stop."""
    size = SIZES[axis]
    velocity = {"forward": (size, 0.0, 0.0), "up": (0.0, 0.0, -size)}.get(axis, (0.0, 0.0, 0.0))
    step = Demand(velocity=velocity, yaw_rate_rad_s=size if axis == "yaw" else 0.0)
    still = Demand(velocity=(0.0, 0.0, 0.0), yaw_rate_rad_s=0.0)
    vehicle, controller = Quadrotor(ground_m=100.0), Controller()
    vehicle.down_m = 0.0
    vehicle.step(DT_S, None)  # leaves the ground
    estimator = Estimator(EstimateErrors(), np.random.default_rng(0))
    demands = [still] * 1000 + [step] * round(STEP_S / DT_S) + [still] * round(5.0 / DT_S)
    speeds = []
    for demand in demands:
        estimate = estimator.update(DT_S, vehicle)
        vehicle.step(DT_S, controller.update(DT_S, demand, estimate))
        speed = {"forward": vehicle.v_north_m_s, "up": -vehicle.v_down_m_s}
        speeds.append(speed.get(axis, vehicle.yaw_rate_rad_s))
    return np.array(speeds[1000:])


def split(curve: NDArray[np.float64]) -> dict[str, NDArray[np.float64]]:
    n = round(STEP_S / DT_S)
    return {"step": curve[:n], "stop": curve[n:]}


def time_to(share: float, curve: NDArray[np.float64], of: float) -> float:
    """Seconds until the curve first reaches a share of a value."""
    return float((np.argmax(curve >= share * of) + 1) * DT_S)


def at(curve: NDArray[np.float64], times_s: NDArray[np.float64]) -> NDArray[np.float64]:
    return np.interp(times_s, (np.arange(len(curve)) + 1) * DT_S, curve)


@pytest.mark.parametrize(
    ("axis", "part", "share", "measured_s", "spread_s"),
    [
        ("forward", "step", 0.10, 0.267, 0.012),
        ("forward", "step", 0.63, 0.951, 0.155),
        # no spread was measured for 10 %: twice that of the forward step's 10 %
        ("forward", "stop", 0.10, 0.275, 0.024),
        ("forward", "stop", 0.63, 0.730, 0.036),
        ("yaw", "step", 0.10, 0.158, 0.024),
        ("yaw", "step", 0.63, 0.467, 0.034),
        # The table's 0.87 s and the recorded curve's 0.63 s differ: in between, and within 15 %.
        ("yaw", "step", 0.90, 0.87, 0.13),
        ("up", "step", 0.63, 0.29, 0.02),
    ],
)
def test_a_share_of_the_change_is_reached_within_the_measured_spread(
    axis: str, part: str, share: float, measured_s: float, spread_s: float
) -> None:
    parts = split(response(axis))
    speed = parts["step"][-1]
    curve, change = {
        "step": (parts["step"], SIZES[axis]),
        "stop": (speed - parts["stop"], float(speed)),
    }[part]
    assert time_to(share, curve, change) == pytest.approx(measured_s, abs=spread_s)


def test_forward_speed_lags_for_seconds() -> None:
    curve = response("forward")
    # "about 0.75 at 2 s and 0.83 at 5 s"; 3 of 8 runs, jittering by 0.02, touched 0.9 in 5 s
    assert at(curve, np.array([2.0]))[0] == pytest.approx(0.75, abs=0.04)
    assert at(curve, np.array([5.0]))[0] == pytest.approx(0.83, abs=0.04)


@pytest.mark.parametrize(("axis", "part"), list(RECORDED))
def test_curves_follow_the_recorded_ones(axis: str, part: str) -> None:
    ours = at(split(response(axis))[part], np.array(TIMES_S))
    error = ours - np.array(RECORDED[axis, part])
    # 5 % of the command; yaw gets 9 %, being a compromise between the table and the recording
    limit = {"forward": 0.05, "up": 0.025, "yaw": 0.045}[axis]
    assert float(np.sqrt(np.mean(error**2))) < limit


def hovering(yaw_rad: float = 0.0) -> Quadrotor:
    vehicle = Quadrotor(ground_m=100.0, yaw_rad=yaw_rad)
    vehicle.down_m = 0.0
    vehicle.step(DT_S, None)
    for _ in range(500):
        vehicle.step(DT_S, Command())
    return vehicle


def test_forward_acceleration_pitches_the_nose_down() -> None:
    vehicle = hovering()
    for _ in range(250):
        vehicle.step(DT_S, Command(north_m_s2=1.0))
    assert vehicle.pitch_rad == pytest.approx(-math.atan2(1.0, GRAVITY_M_S2), rel=0.02)
    assert abs(vehicle.roll_rad) < 1e-6


def test_acceleration_to_the_right_rolls_to_the_right() -> None:
    vehicle = hovering(yaw_rad=math.pi / 2)  # the right is south
    for _ in range(250):
        vehicle.step(DT_S, Command(north_m_s2=-1.0))
    assert vehicle.roll_rad == pytest.approx(math.atan2(1.0, GRAVITY_M_S2), rel=0.02)


def test_tilt_stays_within_its_limit() -> None:
    vehicle = hovering()
    steepest = 0.0
    for _ in range(1000):
        vehicle.step(DT_S, Command(north_m_s2=100.0))
        steepest = max(steepest, -vehicle.pitch_rad)
    # the attitude loop overshoots its limit of 45 degrees by a few percent
    assert TILT_MAX_RAD * 0.99 < steepest < math.radians(50.0)


def test_a_steady_wind_is_held_against() -> None:
    vehicle, controller = hovering(), Controller()
    vehicle.wind_east_m_s = 3.0
    estimator = Estimator(EstimateErrors(), np.random.default_rng(0))
    hold = Demand(position=(0.0, 0.0, vehicle.down_m), velocity=(0.0, 0.0, 0.0))
    for _ in range(10_000):
        estimate = estimator.update(DT_S, vehicle)
        vehicle.step(DT_S, controller.update(DT_S, hold, estimate))
    assert abs(vehicle.east_m) < 0.05
    assert vehicle.roll_rad < -0.1


def test_with_still_rotors_it_falls_and_stays_on_the_ground() -> None:
    vehicle = Quadrotor(ground_m=2.0)
    vehicle.down_m = 0.0
    vehicle.v_north_m_s = 1.0
    for _ in range(500):
        vehicle.step(DT_S, None)
    assert vehicle.on_ground
    assert vehicle.down_m == 2.0
    assert vehicle.v_north_m_s == vehicle.v_down_m_s == 0.0


def test_headings_that_were_demanded_before_a_reset_shift_along_with_it() -> None:
    controller, estimate = Controller(), Estimate(yaw_rad=0.2)
    for _ in range(30):  # the newest demands are on their way
        controller.update(DT_S, Demand(yaw_rad=0.2), estimate)
    controller.shift_heading(0.1)
    estimate.yaw_rad = 0.3
    demands = [Demand(yaw_rad=0.3)] * 30
    rates = [controller.update(DT_S, d, estimate).yaw_rate_rad_s for d in demands]
    assert rates == pytest.approx([0.0] * 30, abs=1e-9)


def test_a_yaw_rate_that_was_demanded_before_a_reset_goes_on() -> None:
    controller, estimate, demand = Controller(), Estimate(), Demand(yaw_rate_rad_s=0.4)
    for _ in range(30):
        controller.update(DT_S, demand, estimate)
    controller.shift_heading(0.1)
    assert controller.update(DT_S, demand, estimate).yaw_rate_rad_s == pytest.approx(0.4)
