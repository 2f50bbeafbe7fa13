"""The simulated state estimate errs as PX4's did in recorded flights.

The table holds statistics of seven flights of PX4 v1.17 with its built-in quadrotor simulation, at
0.02 (three flights), 0.1 (three) and 1.0 (one) of that simulation's sensor noise: 12 to 16 s of
Hold at 1.5 m, in the first two followed by 15 to 57 s of offboard flight; 63 s of Hold at 1.0.
Estimate minus truth at 42 Hz; the smallest and the largest of the flights.
"""

import math
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cache
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from vehicle_in_hand import ARM, TAKEOFF, VehicleInHand, hovering, setpoint

from dfvs_core.geometry.poses import wrap_angle
from dfvs_sim.dynamics.estimate_errors import EstimateGrade
from dfvs_sim.vehicle.messages.earth import HOME_ALTITUDE_M
from dfvs_sim.vehicle.modes import Mode
from dfvs_sim.vehicle.px4 import STEP_NS

Array = NDArray[np.float64]

LOW, MEDIUM, HIGH = EstimateGrade.LOW, EstimateGrade.MEDIUM, EstimateGrade.HIGH
SAMPLE_S = 0.024
STEP_S = STEP_NS / 1e9
FLIGHTS = 6
"""Simulated flights of each grade; their mean is compared."""

RECORDED: dict[str, dict[EstimateGrade, tuple[float, float]]] = {
    "velocity rms, both axes, m/s": {
        LOW: (0.0057, 0.0076),
        MEDIUM: (0.0254, 0.0380),
        HIGH: (0.302, 0.302),
    },
    "position sd, both axes, m": {
        LOW: (0.0037, 0.0040),
        MEDIUM: (0.0147, 0.0275),
        HIGH: (0.185, 0.185),
    },
    "d(position)/dt - velocity rms, both axes, m/s": {
        LOW: (0.0060, 0.0075),
        MEDIUM: (0.0241, 0.0363),
        HIGH: (0.285, 0.285),
    },
    "vertical velocity sd, m/s": {
        LOW: (0.0021, 0.0023),
        MEDIUM: (0.0093, 0.0124),
        HIGH: (0.099, 0.099),
    },
    "roll and pitch sd, deg": {LOW: (0.030, 0.041), MEDIUM: (0.068, 0.124), HIGH: (1.03, 1.03)},
    "heading sd, deg": {LOW: (0.61, 1.13), MEDIUM: (0.58, 0.65), HIGH: (5.76, 5.76)},
    "true speed in Hold rms, both axes, m/s": {
        LOW: (0.0045, 0.0063),
        MEDIUM: (0.0184, 0.0249),
        HIGH: (0.197, 0.197),
    },
}
SIZE_TOLERANCE = 0.25
"""Share around the recorded range: flights of half a minute differ by as much from each other."""

RECORDED_CORRELATION: dict[str, dict[EstimateGrade, tuple[float, float]]] = {
    "velocity after 0.1 s": {LOW: (0.98, 0.99), MEDIUM: (0.98, 0.99), HIGH: (0.99, 0.99)},
    "velocity after 0.5 s": {LOW: (0.83, 0.88), MEDIUM: (0.88, 0.96), HIGH: (0.92, 0.92)},
    "velocity after 1 s": {LOW: (0.62, 0.68), MEDIUM: (0.70, 0.88), HIGH: (0.81, 0.81)},
    "velocity after 2 s": {LOW: (0.28, 0.32), MEDIUM: (0.27, 0.70), HIGH: (0.54, 0.54)},
    "position with velocity": {LOW: (0.82, 0.87), MEDIUM: (0.89, 0.91), HIGH: (0.88, 0.88)},
    "vertical velocity after 0.5 s": {LOW: (0.72, 0.76), MEDIUM: (0.72, 0.85), HIGH: (0.73, 0.73)},
    "roll and pitch after 1 s": {LOW: (0.85, 0.89), MEDIUM: (0.74, 0.91), HIGH: (0.85, 0.85)},
    "heading after 1 s": {LOW: (0.56, 0.86), MEDIUM: (0.62, 0.86), HIGH: (0.96, 0.96)},
}
CORRELATION_TOLERANCE = 0.1
MOTION = (
    *("north_m", "east_m", "down_m", "v_north_m_s", "v_east_m_s", "v_down_m_s"),
    *("roll_rad", "pitch_rad", "yaw_rad"),
)


def fly(grade: EstimateGrade, seed: int) -> tuple[Array, Array, int]:
    """Truth and estimate (n, 9) in the air, and how many of the samples are in Hold."""
    vehicle = hovering(seed=seed, estimate=grade, height_m=1.5)
    rows: list[list[list[float]]] = []

    def sample(seconds: float, message: Any = None) -> None:
        for _ in range(round(seconds / SAMPLE_S)):
            vehicle.run(SAMPLE_S, message)
            both = vehicle.body, vehicle.px4.flight.estimate
            rows.append([[getattr(thing, name) for name in MOTION] for thing in both])

    sample(62.0 if grade is HIGH else 12.0)
    hold = len(rows)
    if grade is not HIGH:
        vehicle.run(0.5, setpoint())
        vehicle.set_mode(Mode.OFFBOARD)
        for message in (setpoint(0.3, 0.1, 0.0, 0.2), setpoint(0.0, -0.2), setpoint()):
            sample(6.0, message)
    both = np.array(rows)
    return both[:, 0], both[:, 1], hold


def correlation(x: Array, lag_s: float) -> float:
    x = x - x.mean(axis=0)
    k = round(lag_s / SAMPLE_S)
    return float((x[:-k] * x[k:]).sum() / (x * x).sum())


def rms(x: Array) -> float:
    """Root mean square of the length."""
    return float(np.sqrt((x * x).sum(axis=-1).mean()))


def drift(position: Array, velocity: Array) -> Array:
    """Change of position over five samples less the velocity in the middle."""
    change = (position[5:] - position[:-5]) / (5 * SAMPLE_S)
    return change - velocity[2:-3]


@cache
def flown(grade: EstimateGrade) -> dict[str, float]:
    """Statistics of the simulated flights, by the tables' names."""
    all_flights = [statistics(*fly(grade, seed)) for seed in range(FLIGHTS)]
    return {name: float(np.mean([f[name] for f in all_flights])) for name in all_flights[0]}


def statistics(truth: Array, estimate: Array, hold: int) -> dict[str, float]:
    error = estimate - truth
    angles = np.degrees((error[:, 6:] + np.pi) % (2.0 * np.pi) - np.pi)
    position, velocity, down = error[:, :2], error[:, 3:5], error[:, 5:6]
    tilt, heading = angles[:, :2], angles[:, 2:]
    joint = [np.corrcoef(position[:, i], velocity[:, i])[0, 1] for i in range(2)]
    return {
        "velocity rms, both axes, m/s": rms(velocity),
        "position sd, both axes, m": rms(position - position.mean(axis=0)),
        "d(position)/dt - velocity rms, both axes, m/s": rms(drift(position, velocity)),
        "vertical velocity sd, m/s": float(down.std()),
        "roll and pitch sd, deg": rms(tilt - tilt.mean(axis=0)) / np.sqrt(2.0),
        "heading sd, deg": float(heading.std()),
        "true speed in Hold rms, both axes, m/s": rms(truth[:hold, 3:5]),
        "velocity after 0.1 s": correlation(velocity, 0.1),
        "velocity after 0.5 s": correlation(velocity, 0.5),
        "velocity after 1 s": correlation(velocity, 1.0),
        "velocity after 2 s": correlation(velocity, 2.0),
        "position with velocity": float(np.mean(joint)),
        "vertical velocity after 0.5 s": correlation(down, 0.5),
        "roll and pitch after 1 s": correlation(tilt, 1.0),
        "heading after 1 s": correlation(heading, 1.0),
    }


@pytest.mark.parametrize("grade", [LOW, MEDIUM, HIGH])
@pytest.mark.parametrize("name", list(RECORDED))
def test_the_errors_have_the_recorded_sizes(name: str, grade: EstimateGrade) -> None:
    least, most = RECORDED[name][grade]
    assert (1 - SIZE_TOLERANCE) * least < flown(grade)[name] < (1 + SIZE_TOLERANCE) * most


@pytest.mark.parametrize("grade", [LOW, MEDIUM, HIGH])
@pytest.mark.parametrize("name", list(RECORDED_CORRELATION))
def test_the_errors_have_the_recorded_correlations(name: str, grade: EstimateGrade) -> None:
    least, most = RECORDED_CORRELATION[name][grade]
    assert least - CORRELATION_TOLERANCE < flown(grade)[name] < most + CORRELATION_TOLERANCE


RECORDED_RESET: dict[EstimateGrade, tuple[float, ...]] = {
    LOW: (0.19, 0.43, 2.00),
    MEDIUM: (-0.06, 0.21, 1.66),
    HIGH: (6.47,),
}
"""Changes of the estimated heading, deg, as its estimated height first exceeded 1.5 m."""
RESET_TOLERANCE = 0.5
"""Share around the mean recorded size: three flights are known at most."""


@dataclass(frozen=True, slots=True)
class Reset:
    """What changed in the step of a heading reset, deg, m and m/s, and the true turn after it."""

    heading_deg: float
    moved_m: float
    changed_m_s: float
    tilted_deg: float
    height_m: float
    turned_deg: float


@cache
def resets(grade: EstimateGrade, seed: int) -> tuple[Reset, ...]:
    return tuple(fly_up(grade, seed))


def fly_up(grade: EstimateGrade, seed: int) -> Iterator[Reset]:
    """Heading resets of a flight to 2 m, by ODOMETRY's counter of resets."""
    vehicle = VehicleInHand(seed=seed, estimate=grade)
    vehicle.run_until(lambda: vehicle.px4.status.ready, 10.0)
    flight = vehicle.px4.flight
    e, ground_m = flight.estimate, flight.estimate.down_m
    altitude_m = HOME_ALTITUDE_M - vehicle.px4.status.home_m[2] + 2.0
    vehicle.command(ARM, 1.0)
    vehicle.command(TAKEOFF, *[math.nan] * 6, altitude_m)
    for _ in range(round(12.0 / STEP_S)):
        counter, position, velocity, tilt = e.resets, e.position_m, e.velocity_m_s, e.attitude_rad
        error = wrap_angle(e.yaw_rad - vehicle.body.yaw_rad)
        vehicle.run(STEP_S)
        if e.resets == counter:
            continue
        change = wrap_angle(e.yaw_rad - vehicle.body.yaw_rad) - error
        moved, changed = math.dist(e.position_m, position), math.dist(e.velocity_m_s, velocity)
        tilted, height_m = math.dist(e.attitude_rad[:2], tilt[:2]), ground_m - e.down_m
        before_rad = vehicle.body.yaw_rad
        vehicle.run(0.1)  # longer than what was demanded before the reset still acts
        turned = math.degrees(wrap_angle(vehicle.body.yaw_rad - before_rad))
        degrees = math.degrees(wrap_angle(change)), math.degrees(tilted)
        yield Reset(degrees[0], moved, changed, degrees[1], height_m, turned)


@pytest.mark.parametrize(("grade", "drift_m"), [(LOW, 0.02), (MEDIUM, 0.05), (HIGH, 0.3)])
def test_the_heading_is_reset_once_as_the_estimated_height_exceeds_1_5_m(
    grade: EstimateGrade, drift_m: float
) -> None:
    """Above the ground as estimated at lift-off; the estimated height drifts until then."""
    for seed in range(FLIGHTS):
        (reset,) = resets(grade, seed)
        assert reset.height_m == pytest.approx(1.5, abs=drift_m)


@pytest.mark.parametrize("grade", [LOW, MEDIUM, HIGH])
def test_nothing_but_the_heading_jumps_and_the_vehicle_does_not_turn(grade: EstimateGrade) -> None:
    """The autopilot shifts the heading that it holds along: PX4 turned by up to 0.05 deg."""
    quick = 3.0 if grade is HIGH else 1.0
    for seed in range(FLIGHTS):
        for reset in resets(grade, seed):
            assert reset.moved_m < 0.01  # one step of a climb at 1.5 m/s
            assert reset.changed_m_s < 0.05 * quick
            assert reset.tilted_deg < 0.1 * quick
            assert abs(reset.turned_deg) < 0.2 * quick


@pytest.mark.parametrize("grade", [LOW, MEDIUM, HIGH])
def test_the_reset_has_the_recorded_size(grade: EstimateGrade) -> None:
    whole = [resets(grade, seed)[0] for seed in range(FLIGHTS)]
    begun = [next(fly_up(grade, seed)) for seed in range(FLIGHTS, 3 * FLIGHTS)]
    sizes = [abs(reset.heading_deg) for reset in (*whole, *begun)]
    recorded = float(np.mean(np.abs(RECORDED_RESET[grade])))
    assert np.mean(sizes) == pytest.approx(recorded, rel=RESET_TOLERANCE)


def test_a_perfect_estimate_has_no_reset() -> None:
    assert resets(EstimateGrade.PERFECT, 0) == ()


def test_a_perfect_estimate_stands_still_in_hold() -> None:
    truth, estimate, hold = fly(EstimateGrade.PERFECT, 0)
    assert np.array_equal(truth, estimate)
    assert rms(truth[hold // 2 : hold, 3:5]) < 1e-3
