"""Check of PX4's failsafe parameters: advised, and refused values.

A gate that hangs or dies falls silent; from then on only these parameters bring the vehicle to a
stop.
"""

from dfvs_core.gate.events import ParametersRead

LOSS_TIME, LOSS_ACTION = "COM_OF_LOSS_T", "COM_OBL_RC_ACT"

ADVISED_LOSS_S, MAX_LOSS_S = 0.5, 1.0
ADVISED_ACTION = 5

_ACTIONS = {
    0: "position, without a radio return",
    1: "altitude, without a radio return",
    2: "stabilised, without a radio return",
    3: "return",
    4: "land",
    5: "hold",
    6: "terminate",
    7: "disarm",
}
"""COM_OBL_RC_ACT. Without sticks, PX4 flies the modes that need them as return-to-launch."""

_RETURNS = (0, 1, 2, 3)
_STOPS = (4, 5)
"""Actions that bring the vehicle to a stop where it is."""

_RETURN_RISK = "where setpoints stop the vehicle would climb and return to launch"
_LAND_RISK = "where setpoints stop the vehicle would land"


def judge_failsafe(
    t_ns: int,
    loss_s: float | None,
    action: float | None,
    *,
    allow_return: bool = False,
    others: tuple[str, ...] = (),
) -> ParametersRead:
    """Event of the two parameters; None is one that could not be read.

    ``loss_s`` is COM_OF_LOSS_T in s, ``action`` COM_OBL_RC_ACT, and ``t_ns`` the monotonic time of
    the reading. ``allow_return``: a return to launch where setpoints stop is advised against, and
    not refused. ``others`` are refusals of other parameters.
    """
    failsafe = (*_time_refusals(loss_s), *_action_refusals(action, allow_return=allow_return))
    refusals = (*failsafe, *others)
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


def _action_refusals(action: float | None, *, allow_return: bool) -> tuple[str, ...]:
    if action is None:
        return (f"{LOSS_ACTION} could not be read",)
    if action in _STOPS or (action in _RETURNS and allow_return):
        return ()
    if action in _RETURNS:
        return (
            f"{_describe(action)}: {_RETURN_RISK}; set {ADVISED_ACTION} (hold), or "
            "gate.allow_return = true to accept it",
        )
    return (f"{_describe(action)}: the vehicle would fall",)


def _describe(action: float) -> str:
    return f"{LOSS_ACTION} is {action:g} ({_ACTIONS.get(int(action), 'not known')})"


def _advice(loss_s: float | None, action: float | None) -> tuple[str, ...]:
    """What of two values that are accepted would better be changed."""
    advice = []
    if loss_s is not None and abs(loss_s - ADVISED_LOSS_S) > 1e-6:
        advice.append(
            f"{LOSS_TIME} is {loss_s:g}; {ADVISED_LOSS_S:g} is advised: time without setpoints "
            "until the failsafe acts, s"
        )
    if action is not None and action != ADVISED_ACTION:
        risk = _RETURN_RISK if action in _RETURNS else _LAND_RISK
        advice.append(f"{_describe(action)}: {risk}; {ADVISED_ACTION} (hold) is advised")
    return tuple(advice)
