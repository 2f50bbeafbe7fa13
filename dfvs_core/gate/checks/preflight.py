"""Preflight checks."""

from dataclasses import dataclass

from dfvs_core.gate.checks.perception_monitor import PerceptionMonitor
from dfvs_core.gate.config import MS, NEVER, GateConfig, S
from dfvs_core.gate.states import Cause
from dfvs_core.gate.vehicle import (
    Fault,
    VehicleMonitor,
    battery_fault,
    estimate_fault,
    link_fault,
    monitor_fault,
)
from dfvs_core.messages.link import MOUNTING_SCORE


@dataclass(frozen=True, slots=True)
class Check:
    """One line of the preflight list.

    ``detail`` says what is wrong, or what was found where all is well; ``remedy`` what to do about
    it. What is not ``binding`` is advice: it is shown, and refuses nothing. Of what is ``pending``
    nothing is known yet: it refuses nothing either, and does not count as passed.
    """

    name: str
    ok: bool
    detail: str = ""
    remedy: str = ""
    binding: bool = True
    pending: bool = False

    @property
    def refuses(self) -> bool:
        """Whether the gate stays in PREFLIGHT because of this."""
        return self.binding and not self.ok


def preflight(
    vehicle: VehicleMonitor, perception: PerceptionMonitor, config: GateConfig, now_ns: int
) -> tuple[Check, ...]:
    """Preflight list of this moment."""
    return (
        _link(vehicle, config, now_ns),
        _from_fault("estimator", estimate_fault(vehicle, config), _ESTIMATOR),
        _hold(vehicle),
        _health(vehicle, config, now_ns),
        _battery(vehicle, config),
        _parameters(vehicle, config, now_ns),
        _advice(vehicle),
        _from_fault("watch", monitor_fault(vehicle, config, now_ns), _WATCH),
        _frames(perception, config, now_ns),
        _overlap(perception, config),
        _mounting(perception),
    )


_LINK = "check vehicle.mavlink, the cable, and that the autopilot streams what is missing"
SYSTEM_ID = "set vehicle.system_id to the MAV_SYS_ID of this vehicle's autopilot"
_ESTIMATOR = (
    "wait for the autopilot's estimate; give it GNSS, flow or vision, and space to calibrate"
)
_HOLD = "wait for GNSS, or set the estimator's origin in the ground station"
_HEALTH = "see what the ground station says; calibrate, or wait until the autopilot is ready to arm"
_HEALTH_IN_FLIGHT = (
    "see what the ground station says; where it does not pass, land and repair it on the ground"
)
_FAILSAFE = (
    "see what the ground station says, repair it, and select Hold there or on the radio: PX4 stays "
    "in a failsafe until a mode is selected"
)
_ARMING = (
    "see what the ground station says; wait, calibrate, or choose Hold mode; a PX4 before 1.13 "
    "does not report the check: arm it, the check counts on a disarmed vehicle alone"
)
_BATTERY = "charge or change the battery, or give the autopilot a power module"
_ADVISED = "set them in the ground station: COM_OF_LOSS_T 0.5, COM_OBL_RC_ACT 5"
_PARAMETERS = f"{_ADVISED}, speed limits no lower than those of the settings"
_WATCH = "wait a few seconds; where it stays lost, see the log and start the service anew"
_FRAMES = "check the camera, its Zenoh key, its light, and that flow.model is fast enough here"
_SLOW = "raise the camera's rate, or lower flow.working_width_px"
_GOAL = (
    "move to where the goal is in view, or take another goal image; goals of a route stay passed "
    "until the service starts anew"
)
_MOUNTING = "mount the camera as camera.mount says, or correct camera.mount"
_COMMANDER = "end the other commander, or give the vehicle back to Hold or Position mode"


def sole_commander(vehicle: VehicleMonitor, now_ns: int, *, may_be_offboard: bool) -> Check:
    """Refuse a vehicle that somebody else commands, or stands by to.

    ``may_be_offboard`` is for the moment in which the pilot's switch to OFFBOARD is awaited.
    """
    if vehicle.is_offboard and vehicle.is_armed and not may_be_offboard:
        detail = "the vehicle is in OFFBOARD, but not by this service"
    else:
        detail = vehicle.other_commanders.preflight_fault(now_ns)
    return Check("sole commander", not detail, detail, _COMMANDER if detail else "")


def failures(checks: tuple[Check, ...]) -> str:
    """One line that names every check that refuses, empty where there is none."""
    return "; ".join(f"{c.name}: {c.detail}" for c in checks if c.refuses)


def _from_fault(name: str, fault: Fault | None, remedy: str, found: str = "") -> Check:
    if fault is None:
        return Check(name, True, found)
    cause, detail = fault
    return Check(name, False, f"{cause}, {detail}" if detail else str(cause), remedy)


def _link(vehicle: VehicleMonitor, config: GateConfig, now_ns: int) -> Check:
    """Refuse a link that lacks something, or that leads to several autopilots."""
    if ambiguity := vehicle.other_commanders.ambiguous_link:
        return Check("link", False, ambiguity, SYSTEM_ID)
    return _from_fault("link", link_fault(vehicle, config, now_ns), _LINK)


def _health(vehicle: VehicleMonitor, config: GateConfig, now_ns: int) -> Check:
    """Refuse a vehicle in failsafe, with a sensor that is not healthy, or not ready to arm.

    PX4 clears the bit of the estimate for an error and for a mere warning of its arming check,
    such as a large accelerometer bias, and checks in the air as well. There the bit may be missing
    for ``GateTiming.estimate_doubt_ns`` on end, while the check ``estimator`` passes: that judges
    the estimate by ESTIMATOR_STATUS, within 50 ms, and alone ends a flight. On the ground, for any
    other sensor, and where the bit stays away, the check refuses.
    """
    if vehicle.heartbeat.failsafe:
        return Check("health", False, "autopilot in failsafe", _FAILSAFE)
    if not vehicle.health.ok:
        return _unhealthy(vehicle, config, now_ns)
    if not vehicle.is_armed and not vehicle.health.can_arm:
        detail = "the autopilot does not report that its checks before arming pass"
        return Check("health", False, detail, _ARMING)
    return Check("health", True)


def _unhealthy(vehicle: VehicleMonitor, config: GateConfig, now_ns: int) -> Check:
    """Health of a vehicle that reports that something is not healthy."""
    detail, limit_ns = vehicle.health.detail, config.timing.estimate_doubt_ns
    if not vehicle.is_flying:
        return Check("health", False, detail, _HEALTH)
    is_brief = now_ns - vehicle.unhealthy_since_ns <= limit_ns
    if vehicle.health.only_estimate and is_brief and estimate_fault(vehicle, config) is None:
        limit = f"for less than {limit_ns / S:g} s"
        found = f"{detail}, {limit}; the check estimator passes and counts until then"
        return Check("health", True, found)
    return Check("health", False, detail, _HEALTH_IN_FLIGHT)


def _battery(vehicle: VehicleMonitor, config: GateConfig) -> Check:
    remaining = vehicle.battery.remaining
    found = "" if remaining is None else f"{remaining:.0%} left"
    return _from_fault("battery", battery_fault(vehicle, config), _BATTERY, found)


def _parameters(vehicle: VehicleMonitor, config: GateConfig, now_ns: int) -> Check:
    """Refuse parameters that are not known, stop no vehicle, or fly slower than is asked."""
    read = vehicle.parameters
    if now_ns - read.t_ns > config.timing.parameters_age_ns:
        when = "yet" if read.t_ns == NEVER else f"for {(now_ns - read.t_ns) / S:.0f} s"
        return Check("parameters", False, f"not read back {when}", "wait a few seconds")
    detail = "; ".join(read.refusals)
    return Check("parameters", not detail, detail or read.found, _PARAMETERS if detail else "")


def _hold(vehicle: VehicleMonitor) -> Check:
    if vehicle.estimator.has_global_position:
        return Check("hold", ok=True)
    detail = "PX4 refuses Hold without a global position; what ends in Hold would land"
    return Check("hold", ok=False, detail=detail, remedy=_HOLD, binding=False)


def _advice(vehicle: VehicleMonitor) -> Check:
    detail = "; ".join(vehicle.parameters.advice)
    remedy = _ADVISED if detail else ""
    return Check("advised parameters", not detail, detail, remedy, binding=False)


def _frames(perception: PerceptionMonitor, config: GateConfig, now_ns: int) -> Check:
    """Refuse frames that are faulty, too few, or too old before the next result replaces them."""
    rate_hz, delay_ns = perception.pace(now_ns)
    age_ns, limit_ns = perception.replaced_age_ns(now_ns), config.timing.frame_age_ns
    found = f"{rate_hz:.1f} a second, results {delay_ns / MS:.0f} ms after capture"
    stale = perception.stale(now_ns)
    if stale is not None and (stale[0] is not Cause.FRAME_OLD or age_ns <= limit_ns):
        return _from_fault("frames", stale, _FRAMES)
    if rate_hz < config.min_frame_hz:
        needed = f"{config.min_frame_hz:g} needed"
        return Check("frames", False, f"{found}; {needed}", _FRAMES)
    if age_ns > limit_ns:
        age = f"period and delay {age_ns / MS:.0f} ms together, {limit_ns / MS:.0f} ms at most"
        return Check("frames", False, f"{found}; {age}", _SLOW)
    return Check("frames", True, found)


def _overlap(perception: PerceptionMonitor, config: GateConfig) -> Check:
    if perception.lost:
        return Check("goal", False, f"goal lost, {perception.reason}", _GOAL)
    if lack := perception.lack_of_overlap(config.min_overlap):
        return Check("goal", False, lack, _GOAL)
    return Check("goal", True, f"overlap {perception.overlap:.0%}")


def _mounting(perception: PerceptionMonitor) -> Check:
    """Refuse a camera whose images turn about another axis than the vehicle does."""
    if (fault := perception.mounting_fault()) is not None:
        return Check("mounting", False, f"{fault[0]}: {fault[1]}", _MOUNTING)
    score = None if perception.good is None else perception.good.mounting_score
    if score is None or score < MOUNTING_SCORE:
        return Check("mounting", True, "not known before the vehicle tilts", pending=True)
    return Check("mounting", True, f"right by {score:.0f} standard deviations")
