"""The preflight list word by word: what an operator reads before every flight."""

import math

import pytest
from gate_rehearsal import TICK_NS, Rehearsal, pilot_config

from dfvs_core.gate.checks.preflight import Check, failures, sole_commander
from dfvs_core.gate.config import MS, GateConfig, S
from dfvs_core.gate.events import (
    AmbiguousLink,
    Battery,
    EstimatorState,
    ForeignSetpoint,
    Health,
    Heartbeat,
    OtherServices,
    ParametersRead,
    VehicleMode,
)
from dfvs_core.gate.machine import GateMachine
from dfvs_core.gate.states import GateState
from dfvs_core.gate.vehicle import VehicleMonitor

LINK = "check vehicle.mavlink, the cable, and that the autopilot streams what is missing"
ESTIMATOR = (
    "wait for the autopilot's estimate; give it GNSS, flow or vision, and space to calibrate"
)
FAILSAFE = (
    "see what the ground station says, repair it, and select Hold there or on the radio: PX4 stays "
    "in a failsafe until a mode is selected"
)
HEALTH = "see what the ground station says; calibrate, or wait until the autopilot is ready to arm"
ARMING = (
    "see what the ground station says; wait, calibrate, or choose Hold mode; a PX4 before 1.13 "
    "does not report the check: arm it, the check counts on a disarmed vehicle alone"
)
BATTERY = "charge or change the battery, or give the autopilot a power module"
ADVISED_PARAMETERS = "set them in the ground station: COM_OF_LOSS_T 0.5, COM_OBL_RC_ACT 5"
PARAMETERS = f"{ADVISED_PARAMETERS}, speed limits no lower than those of the settings"
WATCH = "wait a few seconds; where it stays lost, see the log and start the service anew"
FRAMES = "check the camera, its Zenoh key, its light, and that flow.model is fast enough here"
SLOW = "raise the camera's rate, or lower flow.working_width_px"
GOAL = (
    "move to where the goal is in view, or take another goal image; goals of a route stay passed "
    "until the service starts anew"
)
MOUNTING = "mount the camera as camera.mount says, or correct camera.mount"
COMMANDER = "end the other commander, or give the vehicle back to Hold or Position mode"
LOST = "goal lost, perception unhealthy: wrong goal"
UNKNOWN_MOUNTING = Check(
    "mounting", True, "not known before the vehicle tilts", "", binding=True, pending=True
)
ADVISED = Check("advised parameters", True, "", "", False)


def ready():
    return Rehearsal(pilot_config()).until(GateState.READY)


def listed(gate):
    return {check.name: check for check in gate.machine.checks()}


def test_before_anything_is_heard():
    assert GateMachine(GateConfig(), 0).checks() == (
        Check("link", False, "vehicle's heartbeat lost, none heard yet", LINK),
        Check("estimator", False, "estimator invalid, none heard yet", ESTIMATOR),
        Check("hold", True, "", ""),
        Check("health", False, "none heard yet", HEALTH),
        Check("battery", False, "battery low, charge unknown", BATTERY),
        Check("parameters", False, "not read back yet", "wait a few seconds"),
        ADVISED,
        Check("watch", False, "watch lost, other services, none heard yet", WATCH),
        Check("frames", False, "no good data, no report yet", FRAMES),
        Check("goal", False, "overlap 0%, 9% needed", GOAL),
        UNKNOWN_MOUNTING,
        Check("sole commander", True, "", ""),
    )


def test_where_all_is_well():
    gate = ready()
    gate.tick(ParametersRead(gate.now_ns, found="COM_OF_LOSS_T 0.5, COM_OBL_RC_ACT 5"))
    assert gate.machine.checks() == (
        Check("link", True, "", ""),
        Check("estimator", True, "", ""),
        Check("hold", True, "", ""),
        Check("health", True, "", ""),
        Check("battery", True, "90% left", ""),
        Check("parameters", True, "COM_OF_LOSS_T 0.5, COM_OBL_RC_ACT 5", ""),
        ADVISED,
        Check("watch", True, "", ""),
        Check("frames", True, "50.0 a second, results 40 ms after capture", ""),
        Check("goal", True, "overlap 80%", ""),
        UNKNOWN_MOUNTING,
        Check("sole commander", True, "", ""),
    )


@pytest.mark.parametrize(
    ("changes", "expected"),
    [
        ({"failsafe": True}, Check("health", False, "autopilot in failsafe", FAILSAFE)),
        (
            {"armed": False, "can_arm": False},
            Check(
                "health",
                False,
                "the autopilot does not report that its checks before arming pass",
                ARMING,
            ),
        ),
        ({"battery": 0.1}, Check("battery", False, "battery low, 10% left, 20% needed", BATTERY)),
    ],
)
def test_an_unfit_vehicle(changes, expected):
    gate = ready()
    gate.beat(**changes)
    gate.tick()
    assert listed(gate)[expected.name] == expected


def test_a_fault_without_details_is_named_alone():
    gate = ready()
    gate.send([EstimatorState(gate.now_ns, valid=False)])
    assert listed(gate)["estimator"] == Check("estimator", False, "estimator invalid", ESTIMATOR)


def test_a_vehicle_without_a_global_position_is_warned_of():
    gate = ready()
    gate.send([EstimatorState(gate.now_ns, valid=True, has_global_position=False)])
    hold = listed(gate)["hold"]
    assert (hold.ok, hold.refuses) == (False, False)
    assert hold.detail == (
        "PX4 refuses Hold without a global position; what ends in Hold would land"
    )
    assert hold.remedy == "wait for GNSS, or set the estimator's origin in the ground station"


def test_parameters_with_refusals_and_with_advice():
    gate = ready()
    gate.tick(ParametersRead(gate.now_ns, refusals=("one", "two")))
    assert listed(gate)["parameters"] == Check("parameters", False, "one; two", PARAMETERS)
    gate.tick(ParametersRead(gate.now_ns, advice=("three", "four"), found="found"))
    assert listed(gate)["parameters"] == Check("parameters", True, "found", "")
    advised = Check("advised parameters", False, "three; four", ADVISED_PARAMETERS, False)
    assert listed(gate)["advised parameters"] == advised
    assert not advised.refuses


@pytest.mark.parametrize(
    ("changes", "name", "detail", "remedy"),
    [
        ({"overlap": 0.08}, "goal", "overlap 8%, 9% needed", GOAL),
        ({"healthy": False, "lost": True, "reason": "wrong goal"}, "goal", LOST, GOAL),
        (
            {"healthy": False, "reason": "too dark"},
            "frames",
            "perception unhealthy, too dark",
            FRAMES,
        ),
    ],
)
def test_a_view_that_does_not_fit(changes, name, detail, remedy):
    gate = Rehearsal(pilot_config(), changes=changes).run(5.0)
    assert listed(gate)[name] == Check(name, False, detail, remedy)
    assert gate.state is GateState.PREFLIGHT
    assert f"{name}: {detail}" in gate.machine.reason


@pytest.mark.parametrize("score", [None, 0.0, math.nextafter(5.0, 0.0), math.nextafter(-5.0, 0.0)])
def test_a_mounting_that_nothing_tells_of_yet(score):
    gate = ready()
    gate.changes = {"mounting_score": score}
    gate.tick()
    assert listed(gate)["mounting"] == UNKNOWN_MOUNTING
    assert gate.machine.state is GateState.READY


def test_a_mounting_that_is_clearly_right():
    gate = ready()
    gate.changes = {"mounting_score": 5.0}
    gate.tick()
    assert listed(gate)["mounting"] == Check("mounting", True, "right by 5 standard deviations")


def test_a_mounting_that_is_clearly_wrong():
    gate = ready()
    gate.changes = {"mounting_score": -5.0}
    gate.tick()
    detail = (
        "camera turns another way than the vehicle: 5 standard deviations; "
        "is it mounted as camera.mount says?"
    )
    assert listed(gate)["mounting"] == Check("mounting", False, detail, MOUNTING)
    gate.until(GateState.PREFLIGHT, 1.0)
    assert gate.last.detail == f"mounting: {detail}"


def test_frames_that_are_too_few():
    gate = Rehearsal(pilot_config(min_frame_hz=60.0)).run(3.0)
    detail = "50.0 a second, results 40 ms after capture; 60 needed"
    assert listed(gate)["frames"] == Check("frames", False, detail, FRAMES)


def slow(period_ms, latency_ms):
    """Gate after 5 s of frames, its states since, and what it said of them in the last second."""
    gate, said = Rehearsal(pilot_config(), latency_ns=latency_ms * MS), set()
    for k in range(5 * S // TICK_NS):
        gate.sees = k * TICK_NS % (period_ms * MS) == 0
        gate.tick()
        if k * TICK_NS >= 4 * S:
            said.add(listed(gate)["frames"])
    return gate, said


@pytest.mark.parametrize(
    ("period_ms", "latency_ms", "detail"),
    [
        (100, 170, "10.0 a second, results 170 ms after capture; period and delay 270 ms"),
        (120, 140, "a second, results 140 ms after capture; period and delay 260 ms"),
        (60, 200, "a second, results 200 ms after capture; period and delay 260 ms"),
    ],
)
def test_frames_that_expire_before_the_next_result_are_refused_all_the_time(
    period_ms, latency_ms, detail
):
    gate, said = slow(period_ms, latency_ms)
    assert gate.state is GateState.PREFLIGHT
    assert {(check.refuses, check.remedy) for check in said} == {(True, SLOW)}
    assert all(check.detail.endswith(f"{detail} together, 250 ms at most") for check in said)


@pytest.mark.parametrize(("period_ms", "latency_ms"), [(100, 150), (120, 130), (60, 190)])
def test_frames_that_last_until_the_next_result_pass(period_ms, latency_ms):
    gate, said = slow(period_ms, latency_ms)
    assert gate.state is GateState.READY
    assert all(check.ok for check in said)


def test_slow_frames_that_stay_away_are_the_cameras_fault_after_a_second():
    gate, _ = slow(100, 170)
    gate.sees = False
    gate.run(1.02)
    assert listed(gate)["frames"].remedy == FRAMES


def test_fast_frames_that_stay_away_are_the_cameras_fault_at_once():
    gate = ready()
    gate.sees = False
    gate.run(0.3)
    found = Check("frames", False, "last good frame too old, 260 ms", FRAMES)
    assert listed(gate)["frames"] == found


def test_several_autopilots_on_one_link():
    gate = Rehearsal(pilot_config()).until(GateState.READY)
    detail = "autopilots of systems 3 and 7 on one link, 7 was heard first"
    gate.send([AmbiguousLink(gate.now_ns, detail)])
    remedy = "set vehicle.system_id to the MAV_SYS_ID of this vehicle's autopilot"
    assert listed(gate)["link"] == Check("link", False, detail, remedy)
    gate.until(GateState.PREFLIGHT, 1.0)
    assert gate.last.detail == f"link: {detail}"
    assert gate.run(5.0).state is GateState.PREFLIGHT


def test_others_who_command():
    gate = Rehearsal(pilot_config()).until(GateState.PREFLIGHT)
    gate.beat(mode=gate.vehicle.mode)
    vehicle, now_ns = gate.machine.vehicle, gate.now_ns
    vehicle.update(ForeignSetpoint(now_ns, "from afar"))
    detail = "somebody else sends setpoints (from afar)"
    found = sole_commander(vehicle, now_ns, may_be_offboard=False)
    assert found == Check("sole commander", False, detail, COMMANDER)
    vehicle.update(OtherServices(now_ns, ("a", "b"), ("c",)))
    detail = "another service for this vehicle runs (a, b, c): stop one of them"
    found = sole_commander(vehicle, now_ns, may_be_offboard=True)
    assert found == Check("sole commander", False, detail, COMMANDER)


@pytest.mark.parametrize("armed", [True, False])
@pytest.mark.parametrize("awaited", [True, False])
def test_offboard_by_somebody_else(armed, awaited):
    vehicle = VehicleMonitor(heartbeat=Heartbeat(0, VehicleMode.OFFBOARD, armed))
    found = sole_commander(vehicle, 0, may_be_offboard=awaited)
    detail = "the vehicle is in OFFBOARD, but not by this service"
    bad = Check("sole commander", False, detail, COMMANDER)
    assert found == (bad if armed and not awaited else Check("sole commander", True, "", ""))


def test_a_charge_that_nobody_asks_for_is_no_finding():
    gate = Rehearsal(pilot_config(min_battery=0.0)).until(GateState.READY)
    gate.send([Battery(gate.now_ns, None), Health(gate.now_ns, ok=True)])
    assert listed(gate)["battery"] == Check("battery", True, "", "")


def test_failures_are_one_line_of_those_that_refuse():
    checks = (
        Check("a", False, "one"),
        Check("b", True, "two"),
        Check("c", False, "three", binding=False),
        Check("d", False, "four"),
    )
    assert failures(checks) == "a: one; d: four"
