"""When it is enough, and when it is hopeless: the stop rule and the watch on progress.

Photometric error never decides: light changes. What counts is the distance and angle that the
correspondences show, whether they still shrink, and whether the vehicle has come to rest.
"""

from __future__ import annotations

from dataclasses import dataclass

from dfvs_core.servo.config import ServoConfig

SETTLE_WINDOW_NS = 600_000_000
_STEADY = 0.2
_WELL_INSIDE = 0.4
_PROGRESS_FACTOR = 0.95
_NEARLY_THERE = 3.0
_AT_REST_M_S = 0.05


@dataclass(frozen=True, slots=True)
class ErrorScore:
    """The error of one frame in units of the tolerance: 1 is just good enough."""

    t_ns: int
    score: float


@dataclass(frozen=True, slots=True)
class StopState:
    """Memory of the stop rule: recent scores, oldest first, and the best one so far."""

    recent: tuple[ErrorScore, ...] = ()
    best: ErrorScore | None = None


def error_score(error_m: float, error_rad: float, config: ServoConfig) -> float:
    """Error in units of the tolerance, the worse of distance and angle."""
    return max(error_m / config.tolerance_m, error_rad / config.tolerance_rad)


def update_stop(state: StopState, now: ErrorScore, engaged: bool) -> StopState:
    """Take one frame's score in; progress counts only while engaged."""
    since = now.t_ns - SETTLE_WINDOW_NS
    recent = (*(s for s in state.recent if s.t_ns >= since), now)
    best = state.best
    if not engaged or best is None or now.score < _PROGRESS_FACTOR * best.score:
        best = now
    return StopState(recent, best)


def is_reached(state: StopState, speed_m_s: float) -> bool:
    """Tell whether the goal is reached: inside tolerance, at rest, and no longer on the move.

    An error that grows again is an overshoot in progress; one that still falls gets better.
    """
    if not state.recent:
        return False
    oldest, newest = state.recent[0], state.recent[-1]
    if newest.score > 1.0 or speed_m_s > _AT_REST_M_S:
        return False
    change = abs(newest.score - oldest.score)
    return newest.score < _WELL_INSIDE or change < _STEADY


def is_stuck(state: StopState, progress_s: float) -> bool:
    """Tell whether the error stopped falling, far from the goal."""
    if not state.recent or state.best is None:
        return False
    newest = state.recent[-1]
    waited_ns = newest.t_ns - state.best.t_ns
    return newest.score > _NEARLY_THERE and waited_ns > progress_s * 1e9
