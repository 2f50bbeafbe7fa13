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
_LEFT_ALONE_M_S = 0.03


@dataclass(frozen=True, slots=True)
class ErrorScore:
    """The error of one frame in units of the tolerance: 1 is just good enough.

    ``feature_error`` does not change when the depth is learnt, as ``score`` does: a start that
    looked a hand's breadth away may turn out to be a metre away, and flying that metre is progress.
    """

    t_ns: int
    score: float
    feature_error: float


@dataclass(frozen=True, slots=True)
class Progress:
    """The smallest errors so far, and when either of them last fell."""

    t_ns: int
    score: float
    feature_error: float


@dataclass(frozen=True, slots=True)
class StopState:
    """Memory of the stop rule: recent scores, oldest first, and the progress so far."""

    recent: tuple[ErrorScore, ...] = ()
    progress: Progress | None = None


def error_score(error_m: float, error_rad: float, config: ServoConfig) -> float:
    """Error in units of the tolerance, the worse of distance and angle."""
    return max(error_m / config.tolerance_m, error_rad / config.tolerance_rad)


def update_stop(state: StopState, now: ErrorScore, engaged: bool) -> StopState:
    """Take one frame's score in; progress counts only while engaged."""
    since = now.t_ns - SETTLE_WINDOW_NS
    recent = (*(s for s in state.recent if s.t_ns >= since), now)
    if not engaged or state.progress is None:
        return StopState(recent, Progress(now.t_ns, now.score, now.feature_error))
    return StopState(recent, _advance(state.progress, now))


def _advance(progress: Progress, now: ErrorScore) -> Progress:
    """Lower each smallest error that was clearly undercut; either one is progress."""
    nearer = now.score < _PROGRESS_FACTOR * progress.score
    alike = now.feature_error < _PROGRESS_FACTOR * progress.feature_error
    return Progress(
        t_ns=now.t_ns if nearer or alike else progress.t_ns,
        score=now.score if nearer else progress.score,
        feature_error=now.feature_error if alike else progress.feature_error,
    )


def is_reached(state: StopState, speed_m_s: float, asked_m_s: float) -> bool:
    """Tell whether the goal is reached: inside tolerance, at rest, and no longer on the move.

    An error that grows again is an overshoot in progress; one that still falls gets better. A
    vehicle that must be pushed to stay where it is (``asked_m_s``; the autopilot's integrators
    are still full of the flight) would drift off as soon as it is left alone.
    """
    if not state.recent:
        return False
    oldest, newest = state.recent[0], state.recent[-1]
    if newest.score > 1.0 or speed_m_s > _AT_REST_M_S or asked_m_s > _LEFT_ALONE_M_S:
        return False
    change = abs(newest.score - oldest.score)
    return newest.score < _WELL_INSIDE or change < _STEADY


def is_stuck(state: StopState, progress_s: float) -> bool:
    """Tell whether the error stopped falling, far from the goal."""
    if not state.recent or state.progress is None:
        return False
    newest = state.recent[-1]
    waited_ns = newest.t_ns - state.progress.t_ns
    return newest.score > _NEARLY_THERE and waited_ns > progress_s * 1e9
