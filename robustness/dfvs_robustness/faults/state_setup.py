"""The ways to every state of the gate, from wherever it is."""

from __future__ import annotations

import time
from collections.abc import Callable

from dfvs_core.gate.events import Action
from dfvs_core.gate.states import ENGAGED, Cause, GateState
from dfvs_robustness.faults.harness import STARTUP_S, STATE_S, Rig
from dfvs_robustness.faults.service import HarnessError, wait_until
from dfvs_sim.vehicle.modes import Mode

S = GateState

_FRAMES_S = 0.3
"""Until frames from a new place have been looked at."""


def bring_to(rig: Rig, state: GateState) -> None:
    """Heal the world and bring the gate to a state.

    Raises
    ------
    HarnessError
        If it does not get there.
    """
    rig.heal()
    rig.ensure_service()
    _WAYS[state](rig)


def _disengage(rig: Rig) -> None:
    if rig.state in ENGAGED:
        rig.operator.order(Action.ABORT)
        rig.await_state(S.ABORT, S.RELEASED)
    rig.world.pilot_mode(Mode.HOLD)
    rig.await_heartbeat()
    rig.place_far()


def _to_preflight(rig: Rig) -> None:
    rig.await_state(S.PREFLIGHT)
    if not wait_until(lambda: "no camera frame" not in str(rig.operator.status), STATE_S):
        raise HarnessError("no frame reaches the service")


def _to_ready(rig: Rig) -> None:
    if rig.state in (*ENGAGED, S.ABORT, S.RELEASED):
        _disengage(rig)
        rig.operator.order(Action.ENGAGE)
        rig.operator.order(Action.HOLD)  # takes the order to engage back
    else:
        rig.await_sight()  # what healed a moment ago may still lead back to PREFLIGHT
    rig.await_state(S.READY, timeout_s=STARTUP_S)


def _to_engage(rig: Rig) -> None:
    if rig.state in (S.IDLE, S.PREFLIGHT):
        rig.await_state(S.READY, timeout_s=STARTUP_S)
    elif rig.state is not S.READY:
        _disengage(rig)
    rig.operator.order(Action.ENGAGE)
    rig.await_state(S.ENGAGE)


def _to_servo(rig: Rig) -> None:
    if rig.state is S.SERVO:  # it may be near its goal already
        rig.operator.order(Action.HOLD)
        rig.await_state(S.HOLD)
    if rig.state is S.HOLD:
        rig.place_far()
        if _is_held(rig):
            rig.operator.order(Action.ENGAGE)
    else:
        _to_engage(rig)
    rig.await_state(S.SERVO)
    if not wait_until(rig.is_moving, STATE_S):
        raise HarnessError(f"nothing moves in {rig.state}")


def _to_hold(rig: Rig) -> None:
    if not _is_held(rig):
        _to_servo(rig)
        rig.operator.order(Action.HOLD)
    rig.await_state(S.HOLD)
    rig.await_sight()


def _to_done(rig: Rig) -> None:
    if rig.state is S.DONE:
        rig.await_sight()
        return
    _to_servo(rig)
    rig.operator.order(Action.HOLD)
    rig.await_state(S.HOLD)
    rig.place_at_goal()
    time.sleep(_FRAMES_S)
    rig.operator.order(Action.ENGAGE)
    rig.await_state(S.DONE)


def _is_held(rig: Rig) -> bool:
    """Whether the gate holds because it was ordered to."""
    return rig.state is S.HOLD and rig.service.log.changes[-1]["cause"] == Cause.OPERATOR_HOLD


_WAYS: dict[GateState, Callable[[Rig], None]] = {
    S.PREFLIGHT: _to_preflight,
    S.READY: _to_ready,
    S.ENGAGE: _to_engage,
    S.SERVO: _to_servo,
    S.HOLD: _to_hold,
    S.DONE: _to_done,
}
