"""Transitions of the engaged states: abort, hold, servo, done."""

from dataclasses import dataclass

from dfvs_core.gate.checks.initial_response import Response
from dfvs_core.gate.checks.perception_monitor import PerceptionMonitor
from dfvs_core.gate.config import GateConfig, OnDone, S
from dfvs_core.gate.engagement import Engagement, cap
from dfvs_core.gate.states import Cause, GateState
from dfvs_core.gate.vehicle import (
    Fault,
    VehicleMonitor,
    flight_fault,
    monitor_fault,
    parameters_fault,
)


@dataclass(frozen=True, slots=True)
class Moment:
    """What a decision is made from; ``in_state_ns`` is the time since the state was entered."""

    now_ns: int
    in_state_ns: int
    state: GateState
    vehicle: VehicleMonitor
    perception: PerceptionMonitor
    config: GateConfig


@dataclass(frozen=True, slots=True)
class Decision:
    """The state to enter now, and why."""

    target: GateState
    cause: Fault


def decide(engagement: Engagement, moment: Moment) -> Decision | None:
    """Say which state must be entered now, None to stay.

    DONE is left for a fault alone: of the vehicle, and where the goal is held by vision, of the
    images. A Hold that was asked for and does not come is one.
    """
    if engagement.handed_over:
        return None
    fault = flight_fault(moment.vehicle, moment.config, moment.now_ns)
    if fault is None:
        fault = moment.vehicle.other_commanders.flight_fault(engagement.start_ns)
    if fault is None and (moment.state is not GateState.DONE or holds_visually(engagement)):
        fault = cap(engagement, moment.vehicle, moment.config, moment.now_ns)
    if fault is not None:
        return Decision(GateState.ABORT, fault)
    if moment.state is GateState.ENGAGE:
        return _decide_engage(engagement, moment)
    if moment.state is GateState.SERVO:
        return _decide_servo(engagement, moment)
    if moment.state is GateState.HOLD:
        return _decide_hold(engagement, moment)
    hands_over = moment.config.on_done is OnDone.HOLD
    if hands_over and moment.in_state_ns > moment.config.timing.confirm_ns:
        return Decision(GateState.ABORT, _not_confirmed(Cause.HOLD_NOT_CONFIRMED, moment))
    return _decide_motion(engagement, moment) if holds_visually(engagement) else None


def _not_confirmed(cause: Cause, moment: Moment) -> Fault:
    return cause, f"within {moment.config.timing.confirm_ns / S:g} s"


def holds_visually(engagement: Engagement) -> bool:
    """Whether the goal is reached, and the vehicle kept there by vision."""
    return engagement.reached_ns is not None


def _decide_engage(engagement: Engagement, moment: Moment) -> Decision | None:
    timing = moment.config.timing
    if moment.in_state_ns < timing.engage_zero_ns:
        return None
    if engagement.is_confirmed:
        return _into_servo(engagement, moment, (Cause.OFFBOARD_CONFIRMED, ""))
    requested_ns = engagement.requested_ns
    if requested_ns is not None and moment.now_ns - requested_ns > timing.confirm_ns:
        return Decision(GateState.ABORT, _not_confirmed(Cause.OFFBOARD_NOT_CONFIRMED, moment))
    return None


def _into_servo(engagement: Engagement, moment: Moment, cause: Fault) -> Decision:
    """Move on to SERVO, or to HOLD where nothing may be flown by right now."""
    if engagement.is_held:
        return Decision(GateState.HOLD, (Cause.OPERATOR_HOLD, ""))
    blocking = _motion_fault(moment)
    return (
        Decision(GateState.SERVO, cause) if blocking is None else Decision(GateState.HOLD, blocking)
    )


def _motion_fault(moment: Moment) -> Fault | None:
    """Say why nothing may move right now: watch, parameters, or data that are not good."""
    return _unwatched(moment) or moment.perception.stale(moment.now_ns)


def _unwatched(moment: Moment) -> Fault | None:
    """Name what is not watched any more, or the parameters that are refused."""
    seen = moment.vehicle, moment.config, moment.now_ns
    return monitor_fault(*seen) or parameters_fault(*seen)


def _decide_servo(engagement: Engagement, moment: Moment) -> Decision | None:
    if (decision := _decide_motion(engagement, moment)) is not None:
        return decision
    reached_ns = min(moment.perception.reached_for_ns(moment.now_ns), moment.in_state_ns)
    if reached_ns >= moment.config.timing.reached_ns:
        return Decision(GateState.DONE, (Cause.GOAL_REACHED, ""))
    return None


def _decide_motion(engagement: Engagement, moment: Moment) -> Decision | None:
    """Stop what moves by vision: for a doubt, a wrong mounting, or no initial response."""
    if (blocking := _motion_fault(moment)) is not None:
        return Decision(GateState.HOLD, blocking)
    if (fault := moment.perception.mounting_fault()) is not None:
        return Decision(GateState.ABORT, fault)
    response = engagement.response
    if response is None:
        return None
    shown = response.evaluate(moment.now_ns, moment.config.timing)
    if shown is Response.CONFIRMED:
        engagement.response = None
        engagement.is_confirmed_response = True
    # An error that is within tolerance need not fall.
    if shown is not Response.FAILED or moment.perception.is_within_tolerance:
        return None
    return Decision(GateState.ABORT, (Cause.ERROR_NOT_FALLING, response.objection))


def _decide_hold(engagement: Engagement, moment: Moment) -> Decision | None:
    timing = moment.config.timing
    if engagement.is_held:
        return None
    watch = _unwatched(moment)
    is_new = not engagement.is_confirmed_response
    lack = moment.perception.lack_of_overlap(moment.config.min_overlap) if is_new else ""
    if moment.in_state_ns > timing.hold_ns:
        reason = _hold_reason(moment, watch, lack)
        return Decision(GateState.ABORT, (Cause.HOLD_TOO_LONG, reason))
    if watch is not None or lack:
        return None
    if moment.perception.good_for_ns(moment.now_ns) >= timing.good_data_ns:
        return _into_servo(engagement, moment, (Cause.DATA_GOOD, ""))
    return None


def held_reason(moment: Moment) -> str:
    """Why HOLD lasts on command, and what else keeps the vehicle from moving."""
    blocking = _motion_fault(moment)
    if blocking is None:
        return str(Cause.OPERATOR_HOLD)
    return f"{Cause.OPERATOR_HOLD}; {blocking[0]}: {blocking[1]}"


def _hold_reason(moment: Moment, watch: Fault | None, lack: str) -> str:
    """Why HOLD lasts; the last fault where data are good now, and have not been for long."""
    if watch is not None:
        return f"{watch[0]}: {watch[1]}"
    is_stale = moment.perception.stale(moment.now_ns) is not None
    return moment.perception.reason if is_stale or not lack else lack
