"""Goal sequence of a route: transition from one goal to the next.

A goal that is out of sight is reached by way of others, each seen from the one before (teach and
repeat). The gate knows one goal only: until the last one, no frame counts as reached for it.
"""

from dataclasses import dataclass, replace

from dfvs_core.servo.exchange import ServoResult, Status

S = 1_000_000_000
PREVIEW_PERIOD_NS = S // 4
IN_SIGHT_PREVIEWS = 2
"""Previews in a row that must show the next goal."""

RESPONSE_NS = 6 * S
"""The gate's initial-response check goes by the error of one goal: it is not changed meanwhile."""


@dataclass(frozen=True, slots=True)
class RouteLimits:
    """When a goal on the way counts as passed, and the next one as in sight.

    ``near_m`` and ``near_rad`` are the error at which the next goal is looked for, ``overlap``
    the share of the view that must show it, ``patience_ns`` how long it may stay out of sight.
    """

    near_m: float = 0.3
    near_rad: float = 0.2
    overlap: float = 0.2
    patience_ns: int = 8 * S


@dataclass(frozen=True, slots=True)
class RouteState:
    """What was seen on the way to one goal; times in ns, None where it is not so.

    ``t_ns`` is the time of the last result.
    """

    t_ns: int | None = None
    engaged_since_ns: int | None = None
    near_since_ns: int | None = None
    previewed_ns: int | None = None
    seen: int = 0


def on_result(
    state: RouteState, limits: RouteLimits, result: ServoResult, t_ns: int, *, engaged: bool
) -> RouteState:
    """State after a frame's result for the current goal."""
    since_ns = (
        (t_ns if state.engaged_since_ns is None else state.engaged_since_ns) if engaged else None
    )
    near = (
        result.status is Status.OK
        and result.error_m <= limits.near_m
        and result.error_rad <= limits.near_rad
    )
    if not near:
        return RouteState(t_ns, since_ns, None, state.previewed_ns, 0)
    near_ns = t_ns if state.near_since_ns is None else state.near_since_ns
    return replace(state, t_ns=t_ns, engaged_since_ns=since_ns, near_since_ns=near_ns)


def on_paused_result(
    state: RouteState, limits: RouteLimits, result: ServoResult, t_ns: int
) -> RouteState:
    """State after a frame's result in a HOLD that may lead on: time stands still."""
    pause_ns = 0 if state.t_ns is None else t_ns - state.t_ns
    engaged_ns, near_ns = state.engaged_since_ns, state.near_since_ns
    shifted = replace(
        state,
        engaged_since_ns=None if engaged_ns is None else engaged_ns + pause_ns,
        near_since_ns=None if near_ns is None else near_ns + pause_ns,
    )
    return on_result(shifted, limits, result, t_ns, engaged=engaged_ns is not None)


def _is_response_checked(state: RouteState, t_ns: int) -> bool:
    """Whether the gate's initial-response check may go on."""
    return state.engaged_since_ns is not None and t_ns - state.engaged_since_ns < RESPONSE_NS


def wants_preview(state: RouteState, t_ns: int) -> bool:
    """Whether it is time to look for the next goal."""
    if state.near_since_ns is None or _is_response_checked(state, t_ns):
        return False
    return state.previewed_ns is None or t_ns - state.previewed_ns >= PREVIEW_PERIOD_NS


def on_preview(state: RouteState, limits: RouteLimits, ahead: ServoResult, t_ns: int) -> RouteState:
    """State after the same frame's preview of the next goal."""
    in_sight = ahead.status is Status.OK and ahead.overlap >= limits.overlap
    return replace(state, previewed_ns=t_ns, seen=state.seen + 1 if in_sight else 0)


def may_go_on(state: RouteState, t_ns: int) -> bool:
    """Whether the next goal takes the place of this one."""
    return state.seen >= IN_SIGHT_PREVIEWS and not _is_response_checked(state, t_ns)


def is_lost(state: RouteState, limits: RouteLimits, t_ns: int) -> bool:
    """Whether the next goal should have been in sight for too long."""
    if state.engaged_since_ns is None or state.near_since_ns is None or state.seen:
        return False
    since_ns = max(state.near_since_ns, state.engaged_since_ns + RESPONSE_NS)
    return t_ns - since_ns > limits.patience_ns
