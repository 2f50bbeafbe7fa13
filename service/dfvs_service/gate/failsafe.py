"""What the autopilot does when setpoints stop: which settings are advised, and which are refused.

A gate that hangs or dies falls silent; from then on only these parameters bring the vehicle to a
stop.
"""

from __future__ import annotations

from dfvs_core.gate.events import ParametersRead

LOSS_TIME, LOSS_ACTION = "COM_OF_LOSS_T", "COM_OBL_RC_ACT"

ADVISED_LOSS_S, MAX_LOSS_S = 0.5, 1.0
ADVISED_ACTION = 5

_ACTIONS = {
    0: "position",
    1: "altitude",
    2: "stabilised",
    3: "return",
    4: "land",
    5: "hold",
    6: "terminate",
    7: "disarm",
}
_FALLS = (6, 7)


def judge_failsafe(t_ns: int, loss_s: float | None, action: float | None) -> ParametersRead:
    """Event of the two parameters; None is one that could not be read."""
    refusals = (*_time_refusals(loss_s), *_action_refusals(action))
    advice = () if refusals else _advice(loss_s, action)
    found = "" if refusals else f"{LOSS_TIME} {loss_s:g}, {LOSS_ACTION} {action:g}"
    return ParametersRead(t_ns, advice, refusals, found)


def _time_refusals(loss_s: float | None) -> tuple[str, ...]:
    if loss_s is None:
        return (f"{LOSS_TIME} could not be read",)
    if 0 < loss_s <= MAX_LOSS_S:
        return ()
    return (
        f"{LOSS_TIME} is {loss_s:g} s, {MAX_LOSS_S:g} at most: for so long the vehicle would fly "
        "on blindly",
    )


def _action_refusals(action: float | None) -> tuple[str, ...]:
    if action is None:
        return (f"{LOSS_ACTION} could not be read",)
    if action in _ACTIONS and action not in _FALLS:
        return ()
    meaning = _ACTIONS.get(int(action), "not known")
    return (f"{LOSS_ACTION} is {action:g} ({meaning}): the vehicle would fall",)


def _advice(loss_s: float | None, action: float | None) -> tuple[str, ...]:
    """What of two values that are safe would better be changed."""
    advice = []
    if loss_s is not None and abs(loss_s - ADVISED_LOSS_S) > 1e-6:
        advice.append(
            f"{LOSS_TIME} is {loss_s:g}; {ADVISED_LOSS_S:g} is advised: time without setpoints "
            "until the failsafe acts, s"
        )
    if action is not None and action != ADVISED_ACTION:
        advice.append(
            f"{LOSS_ACTION} is {action:g} ({_ACTIONS[int(action)]}); {ADVISED_ACTION} is advised: "
            "hold where setpoints stop"
        )
    return tuple(advice)
