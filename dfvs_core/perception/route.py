"""Goal sequence of a route: transition from one goal to the next, and recording of the goals.

A goal that is out of sight is reached by way of others, each seen from the one before (teach and
repeat). The gate knows one goal only, and how many follow: a flight ends at the last one.
"""

import enum
from dataclasses import dataclass, replace

from dfvs_core.servo.exchange import ServoResult, Status

S = 1_000_000_000
PREVIEW_PERIOD_NS = S // 4
IN_SIGHT_PREVIEWS = 2
"""Previews in a row that must show the next goal."""


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

    ``t_ns`` is the time of the last result, ``near_ns`` the time in SERVO near the goal.
    """

    t_ns: int | None = None
    near_ns: int | None = None
    previewed_ns: int | None = None
    seen: int = 0


def on_result(
    state: RouteState, limits: RouteLimits, result: ServoResult, t_ns: int, *, engaged: bool
) -> RouteState:
    """State after a frame's result for the current goal."""
    near = (
        result.status is Status.OK
        and result.error_m <= limits.near_m
        and result.error_rad <= limits.near_rad
    )
    if not near:
        return RouteState(t_ns, None, state.previewed_ns, 0)
    near_ns = 0
    if engaged and state.t_ns is not None and state.near_ns is not None:
        near_ns = state.near_ns + t_ns - state.t_ns
    return replace(state, t_ns=t_ns, near_ns=near_ns)


def on_paused_result(
    state: RouteState, limits: RouteLimits, result: ServoResult, t_ns: int
) -> RouteState:
    """State after a frame's result in a HOLD that may lead on: time stands still."""
    return on_result(replace(state, t_ns=t_ns), limits, result, t_ns, engaged=True)


def wants_preview(state: RouteState, t_ns: int) -> bool:
    """Whether it is time to look for the next goal."""
    is_due = state.previewed_ns is None or t_ns - state.previewed_ns >= PREVIEW_PERIOD_NS
    return state.near_ns is not None and is_due


def on_preview(state: RouteState, limits: RouteLimits, ahead: ServoResult, t_ns: int) -> RouteState:
    """State after the same frame's preview of the next goal."""
    in_sight = ahead.status is Status.OK and ahead.overlap >= limits.overlap
    return replace(state, previewed_ns=t_ns, seen=state.seen + 1 if in_sight else 0)


def may_go_on(state: RouteState) -> bool:
    """Whether the next goal takes the place of this one."""
    return state.seen >= IN_SIGHT_PREVIEWS


def is_lost(state: RouteState, limits: RouteLimits) -> bool:
    """Whether the next goal should have been in sight for too long."""
    return state.near_ns is not None and not state.seen and state.near_ns > limits.patience_ns


class KeyframeDecision(enum.Enum):
    """Decision on a frame for the route that is recorded."""

    NEAR = "the last goal is still near"
    DUE = "the next goal is due"
    LOST = "the last goal is out of sight"


@dataclass(frozen=True, slots=True)
class RouteRecordingLimits:
    """How far apart goals are taken; the later flight needs the same overlap and some reserve.

    ``overlap`` is the share of the view that still shows the last goal, relative to the share that
    did at first (a plain wall is never trusted as a whole), ``turn_rad`` the angle to it,
    ``distance`` the way to it over the scene's depth. Below ``stillness``, distance and angle
    together, the vehicle has not moved.
    """

    overlap: float = 0.55
    turn_rad: float = 0.35
    distance: float = 0.3
    stillness: float = 0.05


def evaluate(
    result: ServoResult, limits: RouteRecordingLimits, full_overlap: float
) -> KeyframeDecision:
    """Judge a frame by its result for the last goal.

    ``full_overlap`` is the greatest overlap with that goal so far. The next one is due while the
    last one is in sight for certain, so that the way back can be found.
    """
    if result.status is not Status.OK and result.status is not Status.STUCK:
        return KeyframeDecision.LOST
    distance = result.distance_over_depth
    if distance + result.error_rad < limits.stillness:
        return KeyframeDecision.NEAR
    far = distance > limits.distance or result.error_rad > limits.turn_rad
    is_leaving = result.overlap < limits.overlap * full_overlap
    return KeyframeDecision.DUE if far or is_leaving else KeyframeDecision.NEAR
