"""Stop rule and progress check.

Photometric error never decides: light changes. What counts is where the goal is by the
correspondences, on average over a window: a hovering vehicle is never quite still.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from dfvs_core.geometry.arrays import FloatArray
from dfvs_core.servo.config import ServoConfig
from dfvs_core.servo.goal_filter import GoalEstimate

_SHORT_NS, _LONG_NS = 1_000_000_000, 3_000_000_000
"""Windows of the stop rule: of a calm vehicle, and of one that is moved about."""

_FULL = 0.9
"""Share of its window that the errors must span if none came just before it."""

_LONGEST_PERIOD_NS = 250_000_000
"""Longest time between two frames that are flown by; a longer one is a gap."""

_MOST_SPREAD = 5.0
"""Spread of the error, in tolerances, above which nothing is reached."""

_INDEPENDENT = 3.0
"""Independent errors in the long window, which the uncertainty of their mean follows from."""

_PROGRESS_SHARE, _PROGRESS = 0.05, 5.0
"""Fall of an error that is progress, in parts of it, or in tolerances: far from the goal, at the
reduced speed of the start, the first would take longer than is waited for."""
_SWING = 0.8
"""Ratio of an error to the largest since the goal was passed, below which a vehicle comes back; and
of that largest to the one of the pass before, below which coming back is progress."""
_LEARNT = 0.8
"""Uncertainty of the metric scale over the least so far, below which errors begin anew: distances
before it are of another length, and flying to learn it is progress."""
_NEARLY_THERE = 3.0
"""Error in tolerances, and mean error in spreads, below which progress is not asked for."""


@dataclass(frozen=True, slots=True)
class ErrorSample:
    """Error of one frame in units of the tolerance: 1 is just good enough.

    ``offset`` (3,) is the goal's position and ``turn`` (3,) its rotation vector, both in the
    camera's axes. ``feature_error`` does not change when the depth is learnt, as they do: a start
    that seems near may turn out to be far, and flying there is progress. ``scale_spread`` and
    ``restarts`` are the estimate's.
    """

    t_ns: int
    offset: FloatArray
    turn: FloatArray
    feature_error: float
    scale_spread: float = 0.0
    restarts: int = 0

    @property
    def score(self) -> float:
        """The worse of distance and angle."""
        return max(float(np.linalg.norm(self.offset)), float(np.linalg.norm(self.turn)))


@dataclass(frozen=True, slots=True)
class WindowError:
    """Length of the mean error and spread about it, of distance and angle, in tolerances.

    ``is_full``: the samples span the window, that just before it included where no gap follows.
    """

    mean: tuple[float, float]
    spread: tuple[float, float]
    is_full: bool


@dataclass(frozen=True, slots=True)
class Progress:
    """The smallest errors so far, and when either of them last fell; a pause shifts that time.

    They begin anew where the metric scale is known better or the goal's position is another one;
    ``scale_spread`` and ``restarts`` are those of the last time. ``swing`` is the largest score
    since the goal was last passed.
    """

    t_ns: int
    score: float
    feature_error: float
    scale_spread: float = 0.0
    restarts: int = 0
    swing: float = np.inf

    @classmethod
    def of(cls, now: ErrorSample) -> "Progress":
        """Progress that begins with this frame."""
        return cls(now.t_ns, now.score, now.feature_error, now.scale_spread, now.restarts)


@dataclass(frozen=True, slots=True)
class StopState:
    """Memory of the stop rule: recent errors, oldest first, and the progress so far."""

    recent: tuple[ErrorSample, ...] = ()
    progress: Progress | None = None


def error_sample(
    t_ns: int,
    estimate: GoalEstimate,
    turn_rad: FloatArray,
    feature_error: float,
    config: ServoConfig,
) -> ErrorSample:
    """Error of one frame: estimate of the goal's position, and its rotation vector (3,) in rad."""
    offset, turn = estimate.position_m / config.tolerance_m, turn_rad / config.tolerance_rad
    spread, restarts = estimate.scale_spread, estimate.restarts
    return ErrorSample(t_ns, offset, turn, feature_error, spread, restarts)


def update_stop(
    state: StopState, now: ErrorSample, engaged: bool, paused: bool = False
) -> StopState:
    """Take one frame's error in; progress counts only while engaged.

    ``paused``: not engaged, but in a HOLD that may lead on. The time without progress stands still
    then; else it begins anew.
    """
    since = now.t_ns - _LONG_NS
    recent = (*(s for s in state.recent if s.t_ns >= since), now)
    progress = state.progress
    if progress is None or not (engaged or paused):
        progress = Progress.of(now)
    elif paused:
        progress = _pause(progress, state.recent[-1], now)
    else:
        progress = _advance(progress, recent)
    return StopState(recent, progress)


def _pause(progress: Progress, last: ErrorSample, now: ErrorSample) -> Progress:
    """Progress after a frame that does not count, neither its time nor its change of error."""
    return replace(
        progress,
        t_ns=progress.t_ns + now.t_ns - last.t_ns,
        score=_rebased(progress.score, last.score, now.score),
        feature_error=_rebased(progress.feature_error, last.feature_error, now.feature_error),
    )


def _rebased(smallest: float, last: float, now: float) -> float:
    """Smallest error whose ratio to the error stays what it was, or 1 where the error is larger."""
    return now * max(smallest / last, 1.0) if last > 0.0 else now


def _advance(progress: Progress, recent: Sequence[ErrorSample]) -> Progress:
    """Lower each smallest error that was clearly undercut; either one is progress.

    So is coming back after the goal was passed: the smallest score begins anew with that.
    """
    now = recent[-1]
    is_learnt = now.scale_spread < _LEARNT * progress.scale_spread
    if is_learnt or now.restarts != progress.restarts:
        return Progress.of(now)
    peak = max((s.score for s in recent if s.t_ns > progress.t_ns), default=0.0)
    has_passed = progress.score < _NEARLY_THERE < now.score < _SWING * peak
    if has_passed and peak < _SWING * progress.swing:
        progress = replace(progress, t_ns=now.t_ns, score=now.score, swing=peak)
    nearer = progress.score - now.score > min(_PROGRESS_SHARE * progress.score, _PROGRESS)
    alike = now.feature_error < (1.0 - _PROGRESS_SHARE) * progress.feature_error
    return replace(
        progress,
        t_ns=now.t_ns if nearer or alike else progress.t_ns,
        score=now.score if nearer else progress.score,
        feature_error=now.feature_error if alike else progress.feature_error,
    )


def window_error(state: StopState, window_ns: int = _SHORT_NS) -> WindowError:
    """Statistics of the errors of the last ``window_ns``; of no sample, an infinite error."""
    if not state.recent:
        return WindowError((np.inf, np.inf), (np.inf, np.inf), is_full=False)
    newest_ns = state.recent[-1].t_ns
    recent = [s for s in state.recent if s.t_ns >= newest_ns - window_ns]
    before = state.recent[: -len(recent)]
    parts = [np.array([s.offset for s in recent]), np.array([s.turn for s in recent])]
    mean = [float(np.linalg.norm(part.mean(axis=0))) for part in parts]
    spread = [float(np.sqrt(part.var(axis=0).sum())) for part in parts]
    goes_on = bool(before) and recent[0].t_ns - before[-1].t_ns <= _LONGEST_PERIOD_NS
    is_full = goes_on or newest_ns - recent[0].t_ns >= _FULL * window_ns
    return WindowError((mean[0], mean[1]), (spread[0], spread[1]), is_full)


def _is_within(error: WindowError, most: tuple[float, float]) -> bool:
    return error.mean[0] <= most[0] and error.mean[1] <= most[1]


def is_reached(state: StopState) -> bool:
    """Whether the goal is reached: within tolerance on average over a window.

    A calm vehicle, whose spread is within tolerance too, is judged by one second; the mean is then
    known well. One that wind and its own estimate move about is judged by three, and to within the
    uncertainty of that mean. The mean distance has to be within tolerance even where the metric
    scale is two standard deviations larger than estimated: a guessed one says little.
    """
    if not state.recent:
        return False
    most_m = math.exp(-2.0 * state.recent[-1].scale_spread)
    short = window_error(state, _SHORT_NS)
    if short.is_full and _is_within(short, (most_m, 1.0)) and max(short.spread) <= 1.0:
        return True
    long = window_error(state, _LONG_NS)
    margin = [spread / _INDEPENDENT**0.5 for spread in long.spread]
    within = _is_within(long, (most_m + margin[0], 1.0 + margin[1]))
    return long.is_full and within and max(long.spread) <= _MOST_SPREAD


def is_stuck(state: StopState, progress_s: float) -> bool:
    """Whether the error stopped falling, far from the goal and from its own fluctuations."""
    if not state.recent or state.progress is None:
        return False
    if state.recent[-1].t_ns - state.progress.t_ns <= progress_s * 1e9:
        return False
    error = window_error(state, _LONG_NS)
    return any(
        mean > _NEARLY_THERE * max(1.0, spread)
        for mean, spread in zip(error.mean, error.spread, strict=True)
    )
