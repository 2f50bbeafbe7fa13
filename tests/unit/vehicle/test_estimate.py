"""The vehicle's state estimate: its errors, and that the vehicle is flown by it."""

import math
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from vehicle_in_hand import START_NS, VehicleInHand, hovering, in_offboard, setpoint

from dfvs_core.errors import ConfigError
from dfvs_core.geometry.poses import wrap_angle
from dfvs_sim.dynamics.estimate_errors import EstimateErrors, EstimateGrade, errors_of
from dfvs_sim.dynamics.estimator import Estimate, Estimator
from dfvs_sim.dynamics.gauss_markov import FirstOrder, SecondOrder, normal_source
from dfvs_sim.dynamics.rigid_body import Command, Quadrotor
from dfvs_sim.vehicle.modes import Mode
from dfvs_sim.vehicle.motion import flight

DT_S = 0.004
MOTION = (
    *("north_m", "east_m", "down_m", "v_north_m_s", "v_east_m_s", "v_down_m_s"),
    *("a_north_m_s2", "a_east_m_s2", "a_down_m_s2", "roll_rad", "pitch_rad", "yaw_rad"),
)


def motion(thing: Any) -> list[float]:
    return [getattr(thing, name) for name in MOTION]


def airborne() -> Quadrotor:
    vehicle = Quadrotor(ground_m=100.0)
    vehicle.down_m, vehicle.on_ground = 0.0, False
    return vehicle


@pytest.mark.parametrize(
    ("kind", "share", "tolerance"),
    [(FirstOrder, 1.0 / math.e, 0.07), (SecondOrder, 2.0 / math.e, 0.05)],
)
def test_a_process_has_its_size_and_its_autocorrelation_after_its_time(
    kind: type[FirstOrder | SecondOrder], share: float, tolerance: float
) -> None:
    process = kind(0.2, 1.5, normal_source(np.random.default_rng(0)))
    x = np.array([process.step(DT_S) for _ in range(1_000_000)])
    k = round(1.5 / DT_S)
    # 4000 s are some 900 independent values: 3 sigma are 7 % of the deviation
    assert x.std() == pytest.approx(0.2, rel=0.07)
    assert np.mean(x[:-k] * x[k:]) / np.mean(x * x) == pytest.approx(share, abs=tolerance)


def test_a_perfect_estimate_is_the_truth_to_the_last_bit() -> None:
    vehicle = in_offboard(setpoint(0.5, 0.2, 0.0, 0.3), 3.0, estimate=EstimateGrade.PERFECT)
    assert motion(vehicle.px4.flight.estimate) == motion(vehicle.body)


def test_a_seed_gives_the_same_errors_whatever_else_is_drawn() -> None:
    flights = []
    for commands in (0, 5):
        vehicle = VehicleInHand(estimate=EstimateGrade.HIGH)
        for _ in range(commands):  # a mode change draws the delay of its second acknowledgement
            vehicle.command(176, 1.0, 4.0, 3.0)
        vehicle.run(5.0 - vehicle.now_ns / 1e9)
        flights.append(motion(vehicle.px4.flight.estimate))
    assert flights[0] == flights[1]


def test_the_accuracy_that_is_claimed_does_not_tell_the_grade() -> None:
    claims = set()
    for grade in EstimateGrade:
        vehicle = VehicleInHand(estimate=grade)
        m = vehicle.px4.telemetry.build("ESTIMATOR_STATUS", vehicle.now_ns)
        assert m is not None
        claims.add((m.pos_horiz_accuracy, m.pos_vert_accuracy, m.flags, m.vel_ratio))
    assert len(claims) == 1


def test_the_vehicle_follows_its_velocity_estimate_and_truly_wanders() -> None:
    vehicle = hovering(estimate=EstimateGrade.HIGH)
    speeds = []
    for _ in range(300):
        vehicle.run(0.1)
        speeds.append(math.hypot(vehicle.body.v_north_m_s, vehicle.body.v_east_m_s))
    # 0.2 m/s in PX4's flight at its default sensor noise
    assert 0.1 < float(np.sqrt(np.mean(np.square(speeds)))) < 0.4


def test_a_body_velocity_goes_where_the_estimated_heading_points(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    wrong = EstimateErrors(heading_bias_mean_deg=math.degrees(0.3))
    monkeypatch.setattr(flight, "errors_of", lambda grade: wrong)
    to_north = setpoint(frame=1, mask=0x9C7, yaw=0.0)
    vehicle = in_offboard(to_north, 8.0, estimate=EstimateGrade.LOW)
    assert vehicle.body.yaw_rad == pytest.approx(-0.3, abs=0.02)  # the estimate says north
    vehicle.run(3.0, setpoint(0.5))
    course = math.atan2(vehicle.body.v_east_m_s, vehicle.body.v_north_m_s)
    # forward is where the estimated heading points, north; the acceleration began 0.3 rad off
    assert course == pytest.approx(0.0, abs=0.1)
    assert vehicle.body.yaw_rad == pytest.approx(-0.3, abs=0.03)


def test_a_wrong_heading_turns_the_acceleration() -> None:
    vehicle = airborne()
    vehicle.attitude_error_rad = (0.0, 0.0, 0.2)
    for _ in range(250):
        vehicle.step(DT_S, Command(north_m_s2=1.0))
    # the heading is 0.2 rad less than estimated, and so is the direction of the acceleration
    assert math.atan2(vehicle.v_east_m_s, vehicle.v_north_m_s) == pytest.approx(-0.2, abs=0.02)


def test_a_wrong_tilt_is_flown_truly() -> None:
    vehicle = airborne()
    vehicle.attitude_error_rad = (0.02, -0.03, 0.0)
    for _ in range(500):
        vehicle.step(DT_S, Command())
    assert (vehicle.roll_rad, vehicle.pitch_rad) == pytest.approx((-0.02, 0.03), abs=1e-3)


def test_a_reset_shifts_the_estimate_for_good_and_is_counted() -> None:
    vehicle, estimator = Quadrotor(), Estimator(EstimateErrors(), np.random.default_rng(0))
    estimator.reset_position(2.0, 0.0, -1.0)
    for _ in range(2):
        e = estimator.update(DT_S, vehicle)
        assert (e.north_m, e.down_m - vehicle.down_m) == (2.0, -1.0)
        assert e.resets == 1


RESET = EstimateErrors(heading_reset_mean_deg=4.0)


def yaw_deg(estimate: Estimate) -> float:
    return math.degrees(estimate.yaw_rad)


def test_the_heading_is_reset_above_1_5_m_of_estimated_height_once() -> None:
    vehicle, estimator = Quadrotor(ground_m=0.3), Estimator(RESET, np.random.default_rng(0))
    assert yaw_deg(estimator.update(DT_S, vehicle)) == pytest.approx(-4.0)
    assert math.degrees(estimator.attitude_error_rad[2]) == pytest.approx(-4.0)
    vehicle.on_ground, vehicle.down_m = False, -1.2
    e = estimator.update(DT_S, vehicle)
    assert (yaw_deg(e), e.resets) == (pytest.approx(-4.0), 0)
    vehicle.down_m = -1.21
    e = estimator.update(DT_S, vehicle)
    assert (yaw_deg(e), e.resets) == (pytest.approx(0.0), 1)
    assert math.degrees(estimator.heading_change_rad) == pytest.approx(4.0)
    assert estimator.attitude_error_rad[2] == pytest.approx(0.0)
    for down_m in (-1.3, 0.0, -2.0):
        vehicle.down_m = down_m
        e = estimator.update(DT_S, vehicle)
        assert (yaw_deg(e), e.resets) == (pytest.approx(0.0), 1)
        assert estimator.heading_change_rad == 0.0


def test_the_height_is_the_estimated_one_above_where_the_estimate_left_the_ground() -> None:
    vehicle, estimator = Quadrotor(), Estimator(RESET, np.random.default_rng(0))
    estimator.reset_position(0.0, 0.0, -2.0)
    vehicle_ground = estimator.update(DT_S, vehicle)
    assert vehicle_ground.resets == 1
    vehicle.on_ground, vehicle.down_m = False, -1.4
    assert estimator.update(DT_S, vehicle).resets == 1
    estimator.reset_position(0.0, 0.0, -0.2)
    assert estimator.update(DT_S, vehicle).resets == 3


@pytest.mark.parametrize("grade", [EstimateGrade.LOW, EstimateGrade.MEDIUM])
def test_every_message_with_a_heading_tells_of_its_reset(grade: EstimateGrade) -> None:
    vehicle = VehicleInHand(estimate=grade, parameters={"MIS_TAKEOFF_ALT": 2.0})
    vehicle.run(2.0)
    px4 = vehicle.px4
    assert px4.arm(vehicle.now_ns) is None
    assert px4.request_mode(Mode.TAKEOFF, vehicle.now_ns) is None
    vehicle.run_until(lambda: px4.flight.estimate.resets == 1, 20.0)
    change_deg = math.degrees(px4.flight.estimator.heading_change_rad)
    reset_ns = vehicle.now_ns
    vehicle.run(0.2)
    odometry = vehicle.received("ODOMETRY")
    assert [m.reset_counter for m in odometry if m.time_usec * 1000 < reset_ns - START_NS][-1] == 0
    assert odometry[-1].reset_counter == 1

    def jump_deg(name: str, heading: Callable[[Any], float]) -> float:
        before, after = vehicle.received(name), vehicle.received(name, since_ns=reset_ns - 1)
        before = before[: len(before) - len(after)]
        return math.degrees(wrap_angle(heading(after[0]) - heading(before[-1])))

    def of(w: float, x: float, y: float, z: float) -> float:
        return math.atan2(2 * (w * z + x * y), 1 - 2 * (y * y + z * z))

    near = pytest.approx(change_deg, abs=0.3)  # the rest of what wanders between two messages
    assert jump_deg("ATTITUDE", lambda m: m.yaw) == near
    assert jump_deg("ATTITUDE_QUATERNION", lambda m: of(m.q1, m.q2, m.q3, m.q4)) == near
    assert jump_deg("ODOMETRY", lambda m: of(*m.q)) == near
    assert jump_deg("GLOBAL_POSITION_INT", lambda m: math.radians(m.hdg / 100)) == near


def test_a_heading_that_is_held_shifts_along_with_a_reset(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(flight, "errors_of", lambda grade: RESET)
    parameters = {"MIS_TAKEOFF_ALT": 2.0}
    vehicle = VehicleInHand(estimate=EstimateGrade.LOW, parameters=parameters)
    px4 = vehicle.px4
    vehicle.run(2.0)
    px4.arm(vehicle.now_ns)
    px4.request_mode(Mode.TAKEOFF, vehicle.now_ns)
    vehicle.run_until(lambda: vehicle.body.down_m < -1.0, 20.0)
    yaw_rad = vehicle.body.yaw_rad
    vehicle.run(5.0)
    assert px4.flight.estimate.resets == 1
    assert math.degrees(wrap_angle(vehicle.body.yaw_rad - yaw_rad)) == pytest.approx(0.0, abs=0.05)


@pytest.mark.parametrize(
    "wrong", [{"velocity_m_s": -0.1}, {"tilt_time_s": 0.0}, {"heading_deg": math.nan}]
)
def test_sizes_that_are_none_are_refused(wrong: dict[str, float]) -> None:
    with pytest.raises(ConfigError, match=next(iter(wrong))):
        EstimateErrors(**wrong)


def test_every_grade_has_errors_and_they_grow() -> None:
    sizes = [errors_of(grade).velocity_m_s for grade in EstimateGrade]
    assert sizes[0] == 0.0
    assert sizes == sorted(set(sizes))
