"""Limits to the nanosecond: what is exactly at a limit passes, one more does not."""

import dataclasses
import math

import pytest
from gate_rehearsal import Rehearsal, auto_config

from dfvs_core.gate.checks.perception_monitor import PerceptionMonitor
from dfvs_core.gate.checks.preflight import failures, preflight
from dfvs_core.gate.config import MS, GateConfig, GateTiming, OnDone, S
from dfvs_core.gate.engagement import Engagement, cap
from dfvs_core.gate.events import (
    Attitude,
    Battery,
    EstimatorState,
    Health,
    Heartbeat,
    LandedState,
    LocalPosition,
    OtherServices,
    ParametersRead,
    VehicleMode,
)
from dfvs_core.gate.limits import VelocityLimits
from dfvs_core.gate.states import Cause, GateState
from dfvs_core.gate.vehicle import (
    VehicleMonitor,
    battery_fault,
    estimate_fault,
    flight_fault,
    link_fault,
)

NOW_NS = 10**12
CONFIG = GateConfig()


def picture(place=(0.0, 0.0, 0.0), **age_ns):
    """A sound vehicle, its messages as old as said."""
    vehicle = VehicleMonitor()
    t_ns = {name: NOW_NS - age for name, age in age_ns.items()}
    for event in (
        Heartbeat(t_ns.get("heartbeat", NOW_NS), VehicleMode.OFFBOARD, armed=True),
        Attitude(t_ns.get("attitude", NOW_NS), 0.0, 0.0, 0.0),
        LocalPosition(t_ns.get("position", NOW_NS), place, (0.0, 0.0, 0.0)),
        EstimatorState(t_ns.get("estimator", NOW_NS), valid=True),
        LandedState(t_ns.get("landed", NOW_NS), in_air=True, on_ground=False),
        Battery(NOW_NS, 0.2),
        Health(t_ns.get("health", NOW_NS), ok=True),
        ParametersRead(t_ns.get("parameters", NOW_NS)),
        OtherServices(t_ns.get("services", NOW_NS)),
    ):
        vehicle.update(event)
    return vehicle


def test_these_are_the_times_and_limits_that_safety_rests_on():
    assert dataclasses.asdict(GateTiming()) == {
        "setpoint_gap_ns": 15 * MS,
        "frame_age_ns": 250 * MS,
        "result_age_ns": 200 * MS,
        "clock_skew_ns": 5 * MS,
        "heartbeat_age_ns": 2 * S,
        "telemetry_age_ns": 500 * MS,
        "status_age_ns": 2 * S,
        "parameters_age_ns": 30 * S,
        "services_age_ns": 5 * S,
        "estimate_doubt_ns": 5 * S,
        "stall_ns": 150 * MS,
        "slew_step_ns": 100 * MS,
        "ready_after_ns": 1 * S,
        "ready_grace_ns": 500 * MS,
        "engage_zero_ns": 1 * S,
        "confirm_ns": 2 * S,
        "good_data_ns": 1 * S,
        "hold_ns": 3 * S,
        "reached_ns": 1 * S,
        "response_ns": 1 * S,
        "response_limit_ns": 6 * S,
        "mode_known_ns": 1500 * MS,
        "link_silent_ns": 200 * MS,
        "command_valid_ns": 5 * S,
    }
    limits = dataclasses.astuple(VelocityLimits())
    assert limits == pytest.approx((0.5, 0.3, 0.349066, 0.5, 1.047198), abs=1e-6)
    assert (CONFIG.reduced_speed_m_s, CONFIG.max_distance_m) == (0.1, 5.0)
    assert (CONFIG.max_engaged_ns, CONFIG.hold_visual_ns) == (120 * S, 300 * S)
    assert (CONFIG.max_jump_m, CONFIG.on_done) == (0.5, OnDone.ZERO)
    assert (CONFIG.min_overlap, CONFIG.min_battery) == (0.09, 0.2)


@pytest.mark.parametrize(
    ("message", "limit_ns", "detail"),
    [
        ("heartbeat", 2 * S, "last one 2.00 s ago"),
        ("attitude", 500 * MS, "attitude, last one 0.50 s ago"),
        ("position", 500 * MS, "position, last one 0.50 s ago"),
        ("estimator", 2 * S, "estimator's flags, last one 2.00 s ago"),
        ("health", 2 * S, "sensors and battery, last one 2.00 s ago"),
        ("landed", 2 * S, "landed state, last one 2.00 s ago"),
    ],
)
def test_the_link(message, limit_ns, detail):
    assert link_fault(picture(**{message: limit_ns}), CONFIG, NOW_NS) is None
    cause = Cause.HEARTBEAT_LOST if message == "heartbeat" else Cause.TELEMETRY_LOST
    for fault in (link_fault, flight_fault):
        assert fault(picture(**{message: limit_ns + 1}), CONFIG, NOW_NS) == (cause, detail)


def test_parameters_read_too_long_ago():
    sight = PerceptionMonitor(CONFIG.timing)
    fresh = preflight(picture(parameters=30 * S), sight, CONFIG, NOW_NS)
    stale = preflight(picture(parameters=30 * S + 1), sight, CONFIG, NOW_NS)
    assert "parameters" not in failures(fresh)
    assert "parameters: not read back for 30 s" in failures(stale)


def test_the_battery():
    vehicle = picture()
    assert battery_fault(vehicle, CONFIG) is None
    vehicle.update(Battery(NOW_NS, 0.1999))
    assert battery_fault(vehicle, CONFIG) == (Cause.BATTERY_LOW, "20% left, 20% needed")


@pytest.mark.parametrize(("step_m", "speed_m_s"), [(0.5, 0.0), (0.75, 2.5), (0.75, -2.5)])
def test_a_jump_of_the_position(step_m, speed_m_s):
    vehicle = picture()
    later_ns = NOW_NS + 100 * MS
    vehicle.update(LocalPosition(later_ns, (step_m, 0.0, 0.0), (speed_m_s, 0.0, 0.0)))
    assert estimate_fault(vehicle, CONFIG) is None
    vehicle.update(LocalPosition(later_ns, (2 * step_m + 0.01, 0.0, 0.0), (0.0, 0.0, 0.0)))
    cause, detail = estimate_fault(vehicle, CONFIG)
    assert cause is Cause.ESTIMATOR_JUMP
    assert detail == f"by {step_m + 0.01:.2f} m"


def test_a_jump_is_judged_by_how_far_the_velocity_could_have_led():
    vehicle = picture()
    slow = (1.0, 0.0, 0.0)
    vehicle.update(LocalPosition(NOW_NS + 100 * MS, (0.59, 0.0, 0.0), slow))
    assert estimate_fault(vehicle, CONFIG) is None
    vehicle.update(LocalPosition(NOW_NS + 200 * MS, (1.21, 0.0, 0.0), slow))
    assert estimate_fault(vehicle, CONFIG) == (Cause.ESTIMATOR_JUMP, "by 0.52 m")


def test_a_jump_back_does_not_undo_a_jump():
    vehicle = picture()
    for x in (3.0, 3.0, 0.0, 0.0):
        vehicle.update(LocalPosition(NOW_NS, (x, 0.0, 0.0), (0.0, 0.0, 0.0)))
    assert estimate_fault(vehicle, CONFIG) == (Cause.ESTIMATOR_JUMP, "by 3.00 m")


def test_a_vehicle_that_is_neither_in_the_air_nor_on_the_ground_may_fly_on():
    vehicle = picture()
    vehicle.update(LandedState(NOW_NS, in_air=False, on_ground=False))
    assert flight_fault(vehicle, CONFIG, NOW_NS) is None


def engaged(start_ns):
    return Engagement(start_ns, (0.0, 0.0, 0.0), VehicleMode.HOLD, is_confirmed=True)


def test_the_distance_from_the_start():
    assert cap(engaged(NOW_NS), picture(place=(3.0, 4.0, 0.0)), CONFIG, NOW_NS) is None
    far = cap(engaged(NOW_NS), picture(place=(3.0, 4.0, 0.01)), CONFIG, NOW_NS)
    assert far == (Cause.DISTANCE_CAP, "5.00 m, 5 m allowed")


def test_the_time_engaged():
    assert cap(engaged(NOW_NS - 120 * S), picture(), CONFIG, NOW_NS) is None
    late = cap(engaged(NOW_NS - 120 * S - 1), picture(), CONFIG, NOW_NS)
    assert late == (Cause.TIME_CAP, "120 s allowed")


def test_the_time_for_which_the_goal_is_held_by_vision():
    holding = engaged(NOW_NS - 500 * S)
    holding.reached_ns = NOW_NS - 300 * S
    assert cap(holding, picture(), CONFIG, NOW_NS) is None
    assert cap(holding, picture(), CONFIG, NOW_NS + 1) == (Cause.TIME_CAP, "300 s allowed")
    far = cap(holding, picture(place=(3.0, 4.0, 0.01)), CONFIG, NOW_NS)
    assert far == (Cause.DISTANCE_CAP, "5.00 m, 5 m allowed")


def test_the_age_of_the_last_good_frame():
    report = Rehearsal().report(t_capture_ns=NOW_NS).report
    sight = PerceptionMonitor(CONFIG.timing)
    assert sight.update(report, NOW_NS) is None
    assert sight.stale(NOW_NS + 250 * MS) is None
    assert sight.good is not None
    assert sight.stale(NOW_NS + 250 * MS + 1) == (Cause.FRAME_OLD, "250 ms")
    assert sight.stale(NOW_NS) is not None  # once too old, it stays so


@pytest.mark.parametrize(
    "changes",
    [
        {"velocity": (6.0, 8.0, 0.0, 1.0)},
        {"velocity": (0.0, 0.0, 0.0, -10.0)},
        {"error_m": 0.0, "error_rad": 0.0, "overlap": 0.0},
        {"overlap": 1.0, "feature_error": 0.0},
        {"mounting_score": 1e300},
        {"mounting_score": -1e300},
    ],
)
def test_numbers_that_are_just_believed(changes):
    report = Rehearsal().report(t_capture_ns=NOW_NS, **changes).report
    assert PerceptionMonitor(CONFIG.timing).update(report, NOW_NS) is None


def test_the_overlap():
    config = dataclasses.replace(CONFIG, min_frame_hz=1.0)
    sight = PerceptionMonitor(CONFIG.timing)
    sight.update(Rehearsal().report(t_capture_ns=NOW_NS, overlap=0.09).report, NOW_NS)
    assert failures(preflight(picture(), sight, config, NOW_NS)) == ""
    sight.update(Rehearsal().report(t_capture_ns=NOW_NS + 1, overlap=0.0899).report, NOW_NS + 1)
    assert "goal: overlap 9%" in failures(preflight(picture(), sight, config, NOW_NS))


def test_a_repeated_or_older_capture_is_never_flown_by():
    sight = PerceptionMonitor(CONFIG.timing)
    old, new = (
        Rehearsal().report(t_capture_ns=NOW_NS - age_ns, velocity=(speed, 0.0, 0.0, 0.0)).report
        for age_ns, speed in ((50 * MS, 0.4), (20 * MS, 0.2))
    )
    sight.update(new, NOW_NS)
    sight.update(old, NOW_NS)
    assert sight.velocity().forward_m_s == 0.2
    sight.invalidate((Cause.GATE_STALLED, ""))
    sight.update(new, NOW_NS)
    sight.update(old, NOW_NS)
    assert sight.good is None
    assert sight.stale(NOW_NS) == (Cause.GATE_STALLED, "")


def test_why_nothing_may_be_flown_by_is_one_line():
    sight = PerceptionMonitor(CONFIG.timing)
    assert sight.reason == "no good data: no report yet"
    sight.invalidate((Cause.GATE_STALLED, ""))
    assert sight.reason == "gate stalled"


def test_the_rate_of_frames_counts_those_of_the_last_second():
    sight = PerceptionMonitor(CONFIG.timing)
    for t_ns in (NOW_NS, NOW_NS + 800 * MS):
        sight.update(Rehearsal().report(t_capture_ns=t_ns - 100 * MS).report, t_ns)
    assert sight.pace(NOW_NS + 1000 * MS - 1) == (2.0, 100 * MS)
    assert sight.pace(NOW_NS + 1000 * MS) == (1.0, 100 * MS)
    assert sight.pace(NOW_NS + 1800 * MS) == (0.0, 0)


def test_frames_as_fast_as_needed_pass():
    sight = PerceptionMonitor(CONFIG.timing)
    for t_ns in (NOW_NS - 1, NOW_NS):
        sight.update(Rehearsal().report(t_capture_ns=t_ns).report, NOW_NS)
    for needed, text in ((2.0, ""), (2.001, "frames: 2.0 a second")):
        config = dataclasses.replace(CONFIG, min_frame_hz=needed)
        assert failures(preflight(picture(), sight, config, NOW_NS)).startswith(text)
        assert bool(failures(preflight(picture(), sight, config, NOW_NS))) is bool(text)


def test_the_gate_tells_since_when_it_is_in_its_state():
    gate = Rehearsal(auto_config()).until(GateState.SERVO)
    assert gate.machine.since_ns == gate.last.t_ns
    gate.run(0.5)
    assert gate.machine.since_ns == gate.last.t_ns


@pytest.mark.parametrize(
    ("event", "fault"),
    [
        (Attitude(NOW_NS, 0.0, math.nan, 0.0), "estimator invalid: attitude is not finite"),
        (
            LocalPosition(NOW_NS, (0.0, math.inf, 0.0), (0.0, 0.0, 0.0)),
            "estimator invalid: position or velocity is not finite",
        ),
        (Battery(NOW_NS, None), "battery low: charge unknown"),
        (LandedState(NOW_NS, in_air=False, on_ground=True), "vehicle on the ground: "),
    ],
)
def test_faults_of_the_vehicle_word_by_word(event, fault):
    vehicle = picture()
    vehicle.update(event)
    cause, detail = flight_fault(vehicle, CONFIG, NOW_NS)
    assert f"{cause}: {detail}" == fault
