"""The ways to every state of the gate, from wherever it is."""

import time
from collections.abc import Callable

from dfvs_core.gate.events import Action
from dfvs_core.gate.states import ENGAGED, Cause, GateState
from dfvs_robustness.harness.harness import STARTUP_S, STATE_S, Harness
from dfvs_robustness.harness.service import HarnessError, wait_until
from dfvs_sim.vehicle.modes import Mode

S = GateState
FLOWN_OR_ENDED = (*ENGAGED, S.ABORT, S.RELEASED)

_FRAMES_S = 0.3
"""Until frames from a new place have been looked at."""


def reach_state(harness: Harness, state: GateState) -> None:
    """Repair the environment and bring the gate to a state.

    Raises
    ------
    HarnessError
        If it does not get there.
    """
    harness.repair()
    harness.ensure_service()
    _SETUPS[state](harness)


def end_flight(harness: Harness) -> None:
    """Take the vehicle back from a gate that is engaged or was, and let the gate check it anew."""
    _disengage(harness)
    harness.operator.command(Action.ENGAGE)
    harness.operator.command(Action.HOLD)  # takes the command to engage back


def _disengage(harness: Harness) -> None:
    if harness.state in ENGAGED:
        harness.operator.command(Action.ABORT)
        harness.await_state(S.ABORT, S.RELEASED)
    harness.environment.pilot_mode(Mode.HOLD)
    harness.await_heartbeat()
    harness.place_far()


def _to_preflight(harness: Harness) -> None:
    harness.await_state(S.PREFLIGHT)
    if not wait_until(lambda: "no camera frame" not in str(harness.operator.status), STATE_S):
        raise HarnessError("no frame reaches the service")


def _to_ready(harness: Harness) -> None:
    if harness.state in FLOWN_OR_ENDED:
        end_flight(harness)
    else:
        harness.await_goal_in_view()  # a repair may still lead back to PREFLIGHT
    harness.await_state(S.READY, timeout_s=STARTUP_S)


def _to_engage(harness: Harness) -> None:
    if harness.state in (S.IDLE, S.PREFLIGHT):
        harness.await_state(S.READY, timeout_s=STARTUP_S)
    elif harness.state is not S.READY:
        _disengage(harness)
    harness.operator.command(Action.ENGAGE)
    harness.await_state(S.ENGAGE)


def _to_servo(harness: Harness) -> None:
    if harness.state is S.SERVO:  # it may be near its goal already
        harness.operator.command(Action.HOLD)
        harness.await_state(S.HOLD)
    if harness.state is S.HOLD:
        harness.place_far()
        if _is_held(harness):
            harness.operator.command(Action.ENGAGE)
    else:
        _to_engage(harness)
    harness.await_state(S.SERVO)
    if not wait_until(harness.is_moving, STATE_S):
        raise HarnessError(f"nothing moves in {harness.state}")


def _to_hold(harness: Harness) -> None:
    if not _is_held(harness):
        _to_servo(harness)
        harness.operator.command(Action.HOLD)
    harness.await_state(S.HOLD)
    harness.await_goal_in_view()


def _to_done(harness: Harness) -> None:
    if harness.state is S.DONE:
        harness.await_goal_in_view()
        return
    _to_servo(harness)
    harness.operator.command(Action.HOLD)
    harness.await_state(S.HOLD)
    harness.place_at_goal()
    time.sleep(_FRAMES_S)
    harness.operator.command(Action.ENGAGE)
    harness.await_state(S.DONE)


def _is_held(harness: Harness) -> bool:
    """Whether the gate holds because it was commanded to."""
    return (
        harness.state is S.HOLD and harness.service.log.changes[-1]["cause"] == Cause.OPERATOR_HOLD
    )


_SETUPS: dict[GateState, Callable[[Harness], None]] = {
    S.PREFLIGHT: _to_preflight,
    S.READY: _to_ready,
    S.ENGAGE: _to_engage,
    S.SERVO: _to_servo,
    S.HOLD: _to_hold,
    S.DONE: _to_done,
}
