"""Whether the camera moves the way that the vehicle says it does.

A camera that is mounted another way round than the settings say sees the scene move another way,
from the first centimetres on, whatever the goal is. The features of an earlier frame, the
reference, are seen elsewhere now; what moved them is fitted, and its direction over the ground is
compared with the vehicle's own estimate. Depth scales the fitted motion and leaves its direction.

Tilt is fitted too, though the pictures were taken level: a wrong mounting levels them the wrong
way, and half a degree of that moves the features as far as the first motion does. Yaw and climb
are the same for any mounting that is wrong about the vertical; they are taken from the vehicle.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from dfvs_core.arrays import FloatArray
from dfvs_core.servo.feature_error import CellErrors, by_cell, common_cells
from dfvs_core.servo.freedom import MotionBasis
from dfvs_core.servo.interaction import interaction_matrix
from dfvs_core.servo.law import normal_equations
from dfvs_core.servo.points import ServoPoints
from dfvs_core.servo.weights import tukey_weights, weighted_slope

_LEAST_M = 0.02
"""Way over the ground that tells a direction; the vehicle's velocity is off by 0.02 m/s."""

_MOST_M = 0.3
"""What is asked is the first motion's course; later ones would cost time in every frame."""

_MOST_YAW_RAD_M = 2.0
"""Turn per metre of way beyond which a late heading looks like a way."""

_LEAST_OWN = 0.03
"""Share of a way's flow that no tilt could have made, squared."""

_LEAST_ERRORS = 12.0
"""How many of its standard errors long a fitted way is: errors of neighbours are alike, so that
these count as more than they are."""

_LEAST_CELLS = 20
_ROUNDS = 4
_NOISE = 5e-4
_LONGEST_STEP_NS = 500_000_000


@dataclass(frozen=True, slots=True)
class Way:
    """How the vehicle has moved since the reference, by its own estimate.

    ``moved_m`` (3,) is (forward, right, down), ``turned_rad`` the yaw; ``t_ns`` and ``yaw_rad`` are
    time and heading of the last frame.
    """

    t_ns: int
    yaw_rad: float
    moved_m: FloatArray = field(default_factory=lambda: np.zeros(3))
    turned_rad: float = 0.0


def follow(way: Way | None, t_ns: int, velocity_m_s: FloatArray, yaw_rad: float) -> Way:
    """The way until a frame taken at ``t_ns``; None begins it there.

    ``velocity_m_s`` (3,) is forward, right, down; ``yaw_rad`` is unwrapped.
    """
    if way is None:
        return Way(t_ns, yaw_rad)
    dt_s = min(max(t_ns - way.t_ns, 0), _LONGEST_STEP_NS) * 1e-9
    turned_rad = way.turned_rad + yaw_rad - way.yaw_rad
    return Way(t_ns, yaw_rad, way.moved_m + velocity_m_s * dt_s, turned_rad)


def course_agreement(
    reference: CellErrors, points: ServoPoints, basis: MotionBasis, way: Way
) -> float | None:
    """Cosine of the angle between the camera's course over the ground and the vehicle's own.

    Parameters
    ----------
    reference : CellErrors
        Of the frame that the way began with.
    points : ServoPoints
        Of this one.
    basis : MotionBasis
        Of a level body.
    way : Way
        What the vehicle says of its way in between.

    Returns
    -------
    float or None
        1 where both agree, -1 where they are opposite. None where nothing can be told: the way
        is short, long over or mostly a turn, little is in view of both frames, tilt looks the
        same, or the picture is not clear about it.
    """
    length_m = float(np.hypot(*way.moved_m[:2]))
    if not max(_LEAST_M, abs(way.turned_rad) / _MOST_YAW_RAD_M) <= length_m <= _MOST_M:
        return None
    now = by_cell(points, reference.size)
    before, after = common_cells(reference, now)
    if len(after) < _LEAST_CELLS:
        return None
    L = interaction_matrix((reference.xy[before] + now.xy[after]) / 2.0, now.z_m[after])
    known = L @ (basis.B[:, 2:] @ [way.moved_m[2], way.turned_rad])
    flow = now.error[after] - reference.error[before] - known
    # Other features of a cell are seen now, and their error is another one by its slope.
    slope = weighted_slope(reference.xy_goal, reference.error, reference.weight)
    flow -= (now.xy_goal[after] - reference.xy_goal[before]) @ slope
    weight = np.minimum(reference.weight[before], now.weight[after])
    seen = _fitted(L @ _unknown(basis), flow, weight)
    if seen is None:
        return None
    cosine = float(seen @ way.moved_m[:2] / (np.linalg.norm(seen) * length_m))
    return min(max(cosine, -1.0), 1.0)


def _unknown(basis: MotionBasis) -> FloatArray:
    """Twists (6, 4) of the camera: forward and right, roll and pitch of the body."""
    tilt = np.zeros((6, 2))
    tilt[3:] = basis.B[:3, :2]
    return np.hstack([basis.B[:, :2], tilt])


def _fitted(J: FloatArray, flow: FloatArray, weight: FloatArray) -> FloatArray | None:
    """Way over the ground (2,) that explains the flow (N, 2) best; None if it is not clear."""
    factors = np.ones(len(weight))
    for _ in range(_ROUNDS):
        sure = weight * factors
        equations = normal_equations(J, -flow, sure)
        if _own_share(equations.A) < _LEAST_OWN:
            return None
        solution = equations.solve(0.0)
        residual = np.linalg.norm(J @ solution - flow, axis=1)
        factors = tukey_weights(residual, weight, _NOISE)
    way, error = solution[:2], _standard_error(equations.A, residual, sure)
    return way if np.linalg.norm(way) > _LEAST_ERRORS * error else None


def _standard_error(A: FloatArray, residual: FloatArray, sure: FloatArray) -> float:
    """Standard error of a fitted way, m, along the direction in which it is largest."""
    total = float(sure.sum())
    count = total**2 / float((sure**2).sum())
    variance = float((sure * residual**2).sum()) / (2.0 * total)
    covariance = np.linalg.pinv(A)[:2, :2] * variance / count
    return float(np.sqrt(np.linalg.eigvalsh(covariance)[-1]))


def _own_share(A: FloatArray) -> float:
    """Share (0 to 1) of what a way does to the picture that no tilt can do, in the worst course."""
    way, cross, tilt = A[:2, :2], A[:2, 2:], A[2:, 2:]
    own = way - cross @ np.linalg.pinv(tilt) @ cross.T
    scale = float(np.trace(way)) / 2.0
    return float(np.linalg.eigvalsh(own)[0]) / scale if scale > 0.0 else 0.0
