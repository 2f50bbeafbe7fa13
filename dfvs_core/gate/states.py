"""States of the gate, the transitions between them, and their causes."""

import enum
from dataclasses import dataclass


class GateState(enum.StrEnum):
    """Where the gate stands."""

    IDLE = "IDLE"
    """No heartbeat received yet."""
    PREFLIGHT = "PREFLIGHT"
    """Checks are not all passed."""
    READY = "READY"
    """Checks passed; waits for the operator."""
    ENGAGE = "ENGAGE"
    """Zero setpoints stream; OFFBOARD is being requested and confirmed."""
    SERVO = "SERVO"
    """The only state that moves the vehicle."""
    HOLD = "HOLD"
    """Zero setpoints, because something is wrong that may pass."""
    DONE = "DONE"
    """The goal was reached."""
    ABORT = "ABORT"
    """Something is wrong that will not pass: zero, Hold once, silence."""
    RELEASED = "RELEASED"
    """Somebody else has the vehicle: silence, latched."""


ENGAGED = frozenset({GateState.ENGAGE, GateState.SERVO, GateState.HOLD, GateState.DONE})
"""States in which the gate has, or asks for, the vehicle."""

FLYING = frozenset({GateState.ENGAGE, GateState.SERVO, GateState.HOLD})
"""Engaged, and not at the goal yet."""

ENDED = frozenset({GateState.DONE, GateState.ABORT, GateState.RELEASED})
"""States that end a flight, once nothing is sent any more."""

_S = GateState

TRANSITIONS: dict[GateState, frozenset[GateState]] = {
    _S.IDLE: frozenset({_S.PREFLIGHT, _S.ABORT}),
    _S.PREFLIGHT: frozenset({_S.READY, _S.ABORT}),
    _S.READY: frozenset({_S.PREFLIGHT, _S.ENGAGE, _S.ABORT}),
    _S.ENGAGE: frozenset({_S.SERVO, _S.HOLD, _S.ABORT, _S.RELEASED}),
    _S.SERVO: frozenset({_S.HOLD, _S.DONE, _S.ABORT, _S.RELEASED}),
    _S.HOLD: frozenset({_S.SERVO, _S.ABORT, _S.RELEASED}),
    _S.DONE: frozenset({_S.PREFLIGHT, _S.HOLD, _S.ABORT, _S.RELEASED}),
    _S.ABORT: frozenset({_S.PREFLIGHT}),
    _S.RELEASED: frozenset({_S.PREFLIGHT}),
}
"""What may follow what. From the last three only an operator's command leads on: back to PREFLIGHT,
or from DONE to HOLD with another goal."""


class Cause(enum.StrEnum):
    """Why the gate changed its state."""

    HEARTBEAT_RECEIVED = "vehicle heard"
    CHECKS_PASSED = "checks passed"
    CHECKS_FAILED = "checks failed"
    PILOT_ENGAGED = "pilot selected OFFBOARD"
    AUTO_ENGAGED = "armed and in the air"
    COMMAND_ENGAGED = "operator commanded to engage"
    OFFBOARD_CONFIRMED = "OFFBOARD confirmed"
    OFFBOARD_NOT_CONFIRMED = "OFFBOARD not confirmed"
    OFFBOARD_NOT_READY = "OFFBOARD selected while checks fail"
    DATA_GOOD = "good data"
    NO_DATA = "no good data"
    FRAME_OLD = "last good frame too old"
    RESULT_LATE = "result too late"
    REPORT_REJECTED = "report rejected"
    REPORT_UNHEALTHY = "perception unhealthy"
    GATE_STALLED = "gate stalled"
    GOAL_REACHED = "goal reached"
    GOAL_LOST = "goal lost"
    ERROR_NOT_FALLING = "error does not fall"
    WRONG_MOUNTING = "camera turns another way than the vehicle"
    HOLD_TOO_LONG = "held too long"
    HOLD_NOT_CONFIRMED = "Hold not confirmed"
    DISTANCE_CAP = "too far from the start"
    TIME_CAP = "engaged too long"
    HEARTBEAT_LOST = "vehicle's heartbeat lost"
    TELEMETRY_LOST = "vehicle's telemetry lost"
    BATTERY_LOW = "battery low"
    WATCH_LOST = "watch lost"
    PARAMETERS_REFUSED = "parameters refused"
    ESTIMATOR_INVALID = "estimator invalid"
    ESTIMATOR_JUMP = "position estimate jumped"
    FAILSAFE = "autopilot in failsafe"
    LANDED = "vehicle on the ground"
    TAKEOVER = "mode left OFFBOARD"
    TWO_COMMANDERS = "another commander"
    DISARMED = "vehicle disarmed"
    OPERATOR_HOLD = "operator commanded to hold"
    OPERATOR_ABORT = "operator commanded to abort"
    OPERATOR_AGAIN = "operator engages again"
    OPERATOR_GOAL = "operator changed the goal"
    STOPPED = "service stops"
    UNSUPERVISED = "parent process silent"


@dataclass(frozen=True, slots=True)
class Transition:
    """One change of state, to be logged: when (monotonic), from where to where, and why."""

    t_ns: int
    source: GateState
    target: GateState
    cause: Cause
    detail: str = ""

    @property
    def reason(self) -> str:
        """Cause and detail as one line."""
        return f"{self.cause}: {self.detail}" if self.detail else str(self.cause)
