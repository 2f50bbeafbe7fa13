"""Kalman filter of the goal's position, the odometry's error and the metric scale.

The images give the goal's place in units of the relative depth; the odometry gives in metres how
the vehicle moves, with an error that lasts for seconds. Together they give the scale, weighed over
the whole flight, and the error.

State ``x = (p, e, s)``: ``p`` (3,) is the goal position in the camera's axes in units of depth.
``e`` (3,) is the true velocity minus the rate of the odometry's position, m/s, in the same axes.
``s`` is the logarithm of the metres a unit. ``dp/dt = -exp(-s) (r + e)`` with the rate ``r``, ``e``
a first-order Gauss-Markov process, ``s`` constant. A free camera's axes are its own, a vehicle's
those of the gravity-aligned virtual camera.

An autopilot's velocity estimate differs from the rate of its position estimate, and is the worse of
the two; but it is what the autopilot controls. So the difference, low-passed, is kept beside the
state: with ``e`` it is the velocity error that a commanded velocity is flown with.
"""

import math
from dataclasses import dataclass, replace

import numpy as np

from dfvs_core.geometry.arrays import FloatArray

_MOST_STRETCH = 2.0
"""Logarithm of a change of the distance that is none: near the goal it has no size."""

_P, _E, _S = slice(0, 3), slice(3, 6), 6


SCALE_SPREAD = 0.6
"""Standard deviation of ``s`` before anything is known."""
ERROR_M_S = 0.03
ERROR_RANGE_M_S = (0.003, 0.3)
"""Expected ``e``, standard deviation per axis, and bounds of its adaptation."""
ERROR_TIME_S = 0.6
"""Correlation time of ``e``."""
_ADAPTATION_S, _SLIP_TIME_S = 3.0, 0.1
"""Time constants of that adaptation, and of the low-pass of the odometry's own contradiction."""
_SLIP_SHARE = 0.35
"""Least ``e`` over that contradiction: an EKF's position and velocity err together."""
_POSITION_NOISE, _RELATIVE_NOISE = 0.001, 0.02
"""Standard deviation of a measured position over the depth of the scene; and over the distance to
the goal, where the structure of the scene is known."""
_STRUCTURE_NOISE = 0.3
"""What is added to the latter for each unit of the depths' relative standard deviation."""
_CORRELATION_S = 0.3
"""Time over which errors of the measurement are alike; frames closer than that count less."""
_DRIFT_PER_S = 0.001
"""Slow change of the measured position, over the depth of the scene, 1/sqrt(s)."""
GATE, _SCALE_GATE = 30.0, 16.0
"""Normalised innovation squared above which a measurement is an outlier; and above which it does
not update the scale: one right one in a thousand."""
_GUESS_SPREAD = 0.45
"""Mean relative standard deviation of the depths from which on they are a guess: a measurement by
them does not update the scale either."""
_OUTLIERS = 5
"""So many outliers in a row are a new position."""


@dataclass(frozen=True, slots=True)
class OdometryDelta:
    """Motion of the camera between two frames by the odometry.

    ``displacement_m`` (3,), by its position, and ``velocity_m_s`` (3,), the mean of those reported
    at both frames, are in the axes of the earlier frame; ``R_earlier_current`` is (3, 3).
    """

    dt_s: float
    displacement_m: FloatArray
    velocity_m_s: FloatArray
    R_earlier_current: FloatArray


@dataclass(frozen=True, slots=True)
class GoalEstimate:
    """Mean (7,) and covariance (7, 7) of the state; see the module.

    ``error_m_s`` is the adapted standard deviation of ``e`` per axis, ``slip_m_s`` (3,) the rate of
    the odometry's position minus its velocity, low-passed, in the camera's axes. ``outliers``
    counts measurements in a row that were not used, ``restarts`` how often they became a new
    position.
    """

    x: FloatArray
    P: FloatArray
    error_m_s: float
    slip_m_s: FloatArray
    outliers: int = 0
    restarts: int = 0

    @property
    def metres_per_unit(self) -> float:
        """Metric scale."""
        return math.exp(float(self.x[_S]))

    @property
    def scale_spread(self) -> float:
        """Relative standard deviation of the metric scale."""
        return math.sqrt(float(self.P[_S, _S]))

    @property
    def position_m(self) -> FloatArray:
        """Goal position (3,) in the camera's axes, m."""
        return self.metres_per_unit * self.x[_P]

    @property
    def distance_m(self) -> float:
        """Distance to the goal, m."""
        return float(np.linalg.norm(self.position_m))

    @property
    def position_spread_m(self) -> float:
        """Standard deviation of that position at a known scale, m: its largest axis."""
        largest = float(np.linalg.eigvalsh(self.P[_P, _P])[-1])
        return self.metres_per_unit * math.sqrt(max(largest, 0.0))

    @property
    def distance_spread_m(self) -> float:
        """Standard deviation of the distance to the goal, m."""
        return math.hypot(self.position_spread_m, self.distance_m * self.scale_spread)

    @property
    def velocity_error_m_s(self) -> FloatArray:
        """True velocity minus the odometry's (3,), m/s."""
        error: FloatArray = self.x[_E] + self.slip_m_s
        return error


@dataclass(frozen=True, slots=True)
class PositionMeasurement:
    """The goal's position as one frame shows it.

    ``position`` (3,) and the median ``depth`` of the scene are in units; ``spread`` is the mean
    relative standard deviation of the depths that it stands on.
    """

    position: FloatArray
    depth: float
    spread: float

    def noise(self) -> float:
        """Standard deviation of each axis, in units."""
        share = math.hypot(_RELATIVE_NOISE, _STRUCTURE_NOISE * self.spread)
        return math.hypot(
            _POSITION_NOISE * self.depth, share * float(np.linalg.norm(self.position))
        )


def begin(
    seen: PositionMeasurement, scale_spread: float, before: GoalEstimate | None = None
) -> GoalEstimate:
    """Estimate at a first measurement.

    ``scale_spread`` is that of a scale of which nothing is known; 0 for a depth that is metric. Of
    an estimate ``before``, of another goal, velocity error and scale are kept.
    """
    P = np.zeros((7, 7))
    x, slip_m_s = np.zeros(7), np.zeros(3)
    error_m_s = ERROR_M_S
    if before is None:
        P[_E, _E] = np.eye(3) * error_m_s**2
        P[_S, _S] = scale_spread**2
    else:
        x[3:], P[3:, 3:] = before.x[3:], before.P[3:, 3:]
        error_m_s, slip_m_s = before.error_m_s, before.slip_m_s
    x[_P] = seen.position
    P[_P, _P] = np.eye(3) * seen.noise() ** 2
    return GoalEstimate(x, P, error_m_s, slip_m_s)


def predict(estimate: GoalEstimate, moved: OdometryDelta, depth: float) -> GoalEstimate:
    """Estimate in the axes of the current frame, after a motion."""
    dt_s = moved.dt_s
    if dt_s <= 0.0:
        return estimate
    x, per_m = estimate.x, math.exp(-float(estimate.x[_S]))
    kept = math.exp(-dt_s / ERROR_TIME_S)
    R = moved.R_earlier_current.T
    step = (moved.displacement_m + x[_E] * dt_s) * per_m
    F = np.eye(7)
    F[_P, _P], F[_P, _E] = R, -per_m * dt_s * R
    F[_P, _S] = R @ _limited(step, per_m * float(np.linalg.norm(moved.displacement_m)))
    F[_E, _E] = kept * R
    Q = np.zeros(7)
    Q[_P] = dt_s * (_DRIFT_PER_S * depth) ** 2
    Q[_E] = (1.0 - kept**2) * estimate.error_m_s**2
    mean = np.concatenate([R @ (x[_P] - step), kept * (R @ x[_E]), x[_S:]])
    slip = moved.displacement_m / dt_s - moved.velocity_m_s
    share = min(dt_s / _SLIP_TIME_S, 1.0)
    slip_m_s = R @ (estimate.slip_m_s + share * (slip - estimate.slip_m_s))
    return replace(estimate, x=mean, P=F @ estimate.P @ F.T + np.diag(Q), slip_m_s=slip_m_s)


def update(
    estimate: GoalEstimate, seen: PositionMeasurement, dt_s: float, scale_spread: float
) -> GoalEstimate:
    """Estimate after a measurement; an outlier is passed over."""
    spread = seen.noise()
    weight = max(1.0, _CORRELATION_S / max(dt_s, 1e-3))
    innovation = seen.position - estimate.x[_P]
    S = estimate.P[_P, _P] + np.eye(3) * spread**2
    nis = float(innovation @ np.linalg.solve(S, innovation))
    if nis > GATE:
        if estimate.outliers + 1 >= _OUTLIERS:
            return replace(begin(seen, scale_spread, estimate), restarts=estimate.restarts + 1)
        return replace(estimate, outliers=estimate.outliers + 1)
    S += np.eye(3) * spread**2 * (weight - 1.0)
    K = np.linalg.solve(S, estimate.P[_P, :]).T
    x = estimate.x + K @ innovation
    P = estimate.P - K @ S @ K.T
    P = 0.5 * (P + P.T)
    if nis > _SCALE_GATE or seen.spread > _GUESS_SPREAD:
        x[_S], P[_S, _S] = estimate.x[_S], estimate.P[_S, _S]
    adapted = replace(estimate, x=x, P=P, outliers=0)
    return replace(adapted, error_m_s=_adapted(adapted, dt_s))


def restructured(
    estimate: GoalEstimate, before: FloatArray, after: FloatArray, scale_spread: float
) -> GoalEstimate:
    """Estimate after the relative depth has changed, and with it a measured position (3,).

    That is no motion. While the scale is open the distance in metres stays: what the scale is wrong
    by then, the odometry tells from there on. A scale that is known stays.
    """
    stretch = math.log(
        max(float(np.linalg.norm(after)), 1e-9) / max(float(np.linalg.norm(before)), 1e-9)
    )
    if not abs(stretch) < _MOST_STRETCH:
        return estimate
    x, P = estimate.x.copy(), estimate.P.copy()
    x[_P] = after + math.exp(stretch) * (x[_P] - before)
    if P[_S, _S] > 0.0:
        stretch *= P[_S, _S] / max(P[_S, _S], scale_spread**2)
        x[_S] -= stretch
        P[_S, _S] += stretch**2
    return replace(estimate, x=x, P=P)


def _limited(motion: FloatArray, most: float) -> FloatArray:
    """Motion (3,) that tells of the scale: no longer than what the odometry tells of.

    The rest was found by the scale, and is no evidence of it.
    """
    length = float(np.linalg.norm(motion))
    return motion * (most / length) if length > most else motion


def _adapted(estimate: GoalEstimate, dt_s: float) -> float:
    """Standard deviation of ``e`` after what was estimated of it, and by the odometry's slip."""
    x, slip = estimate.x, estimate.slip_m_s
    estimated = float(x[_E] @ x[_E]) + float(np.trace(estimate.P[_E, _E]))
    seen = max(estimated, float(slip @ slip) * _SLIP_SHARE**2) / 3.0
    share = min(dt_s / _ADAPTATION_S, 1.0)
    low, high = ERROR_RANGE_M_S
    mixed = (1.0 - share) * estimate.error_m_s**2 + share * seen
    return min(max(math.sqrt(mixed), low), high)
