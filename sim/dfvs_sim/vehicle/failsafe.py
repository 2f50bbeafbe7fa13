"""Which mode may be flown, what happens when it no longer can, and who may arm.

Pure decisions on ``Status``: nothing here sends or moves anything.
"""

import enum

from dfvs_sim.vehicle.modes import Mode
from dfvs_sim.vehicle.parameters import ParameterTable
from dfvs_sim.vehicle.status import NS_PER_S, Status

_OFFBOARD_LOSS = {
    0: Mode.POSITION,
    1: Mode.ALTITUDE,
    2: Mode.STABILIZED,
    3: Mode.RETURN,
    4: Mode.LAND,
    5: Mode.HOLD,
    6: Mode.TERMINATION,
}
"""COM_OBL_RC_ACT: what to fly when offboard setpoints stop; 7 disarms."""

DISARM_ACTION = 7


class Refusal(enum.Enum):
    """Why something was refused; the value is the text for the ground station."""

    NOT_READY = "Arming denied: preflight checks fail"
    MODE = "Arming denied: not possible in this mode"
    NO_SETPOINTS = "no offboard signal"
    NO_STICKS = "no manual control input"
    NO_MISSION = "no valid mission"
    NO_ESTIMATE = "no local position"
    IN_AIR = "Disarming denied: not landed"


def mode_refusal(
    mode: Mode, status: Status, parameters: ParameterTable, now_ns: int
) -> Refusal | None:
    """Why the mode cannot be flown now; None where it can."""
    if mode is Mode.MISSION:
        return Refusal.NO_MISSION
    sticks_lost = _is_lost(status.manual_ns, now_ns, parameters["COM_RC_LOSS_T"])
    if mode.needs_manual_control and sticks_lost:
        return Refusal.NO_STICKS
    setpoints_lost = _is_lost(status.setpoint_ns, now_ns, parameters["COM_OF_LOSS_T"])
    if mode is Mode.OFFBOARD and setpoints_lost:
        return Refusal.NO_SETPOINTS
    if not status.estimator_ok and mode not in (Mode.MANUAL, Mode.STABILIZED, Mode.LAND):
        return Refusal.NO_ESTIMATE
    return None


def _is_lost(received_ns: int | None, now_ns: int, timeout_s: float) -> bool:
    """Whether nothing was received within the timeout."""
    return received_ns is None or now_ns - received_ns >= timeout_s * NS_PER_S


def arming_refusal(status: Status, parameters: ParameterTable, now_ns: int) -> Refusal | None:
    """Why the vehicle cannot be armed now; None where it can."""
    if not (status.ready and status.estimator_ok):
        return Refusal.NOT_READY
    if status.intended.prevents_arming:
        return Refusal.MODE
    return mode_refusal(status.intended, status, parameters, now_ns)


def flown_mode(status: Status, parameters: ParameterTable, now_ns: int) -> Mode | None:
    """Mode to fly now: the intended one, or the failsafe's; None asks for disarming.

    Where the intended mode becomes possible again it is flown again, without any command: that is
    how PX4 re-enters OFFBOARD when setpoints resume.
    """
    if not status.armed or status.mode is Mode.TERMINATION:
        return status.mode if status.armed else status.intended
    refusal = mode_refusal(status.intended, status, parameters, now_ns)
    if refusal is None:
        return status.intended
    if refusal is Refusal.NO_ESTIMATE:
        return Mode.LAND
    if refusal is Refusal.NO_SETPOINTS:
        return _after_setpoint_loss(status, parameters, now_ns)
    return _return_or_land(status)


def _after_setpoint_loss(status: Status, parameters: ParameterTable, now_ns: int) -> Mode | None:
    """COM_OBL_RC_ACT's mode, or what PX4 falls back to where that one cannot be flown."""
    action = int(parameters["COM_OBL_RC_ACT"])
    if action == DISARM_ACTION:
        return None
    mode = _OFFBOARD_LOSS.get(action, Mode.RETURN)
    return _return_or_land(status) if mode_refusal(mode, status, parameters, now_ns) else mode


def _return_or_land(status: Status) -> Mode:
    """Return to launch, or a landing without a position to return by."""
    return Mode.RETURN if status.estimator_ok else Mode.LAND


def should_disarm(status: Status, parameters: ParameterTable, now_ns: int) -> bool:
    """Whether an armed vehicle on the ground has waited long enough."""
    if not status.armed or not status.landed:
        return False
    if status.flew:
        wait_s, since_ns = parameters["COM_DISARM_LAND"], status.landed_ns
    else:
        wait_s, since_ns = parameters["COM_DISARM_PRFLT"], status.armed_ns
    return wait_s > 0.0 and now_ns - since_ns >= wait_s * NS_PER_S
