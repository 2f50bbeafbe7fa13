"""Whether the camera moves the way that the vehicle says it does.

A camera that is mounted another way round than the settings say sees the scene move another way,
from the first centimetres on, whatever the goal is. The features of an earlier frame, the
reference, are seen elsewhere now. Every course over the ground would have moved each of them along
a line of its own, the further the nearer it is, and never backwards. So courses all around are
tried, with any depth for any feature: the one that leaves least unexplained is compared with the
vehicle's own, and only where it leaves much less than those that lead elsewhere.

Tilt is fitted too, though the pictures were taken level: a wrong mounting levels them the wrong
way, and half a degree of that moves the features as far as the first motion does. Yaw and climb
are the same for any mounting that is wrong about the vertical; they are taken from the vehicle.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np

from dfvs_core.arrays import BoolArray, FloatArray
from dfvs_core.servo.feature_error import CellErrors, by_cell, common_cells
from dfvs_core.servo.freedom import MotionBasis
from dfvs_core.servo.interaction import interaction_matrix
from dfvs_core.servo.points import ServoPoints
from dfvs_core.servo.weights import weighted_median, weighted_slope

_LEAST_M = 0.02
"""Way over the ground that tells a direction; the vehicle's velocity is off by 0.02 m/s."""

_MOST_M = 0.3
"""What is asked is the first motion's course; later ones would cost time in every frame."""

_MOST_YAW_RAD_M = 2.0
"""Turn per metre of way beyond which a late heading looks like a way."""

_LEAST_CELLS = 20
_COSINES = np.cos(np.arange(24) * math.tau / 24)
"""Of the courses that are tried to the vehicle's own, which is the first."""

_ELSEWHERE = 0.3
"""Cosine to the best course up to which another one leads elsewhere."""

_CLEARLY = 2.0
"""How many times what the best course leaves unexplained each that leads elsewhere leaves."""

_ROUNDS = 6
_OUTLIER = 3.0 * 1.4826
"""Misfit from which on more does not count, in medians."""
_NOISE = 2e-4
"""Misfit that is none, normalised units."""
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
        1 where both agree, -1 where they are opposite, in steps of 15 degrees. None where nothing
        can be told: the way is short, long over or mostly a turn, little is in view of both
        frames, tilt looks the same, or the picture is not clear about it.
    """
    length_m = float(np.hypot(*way.moved_m[:2]))
    if not max(_LEAST_M, abs(way.turned_rad) / _MOST_YAW_RAD_M) <= length_m <= _MOST_M:
        return None
    now = by_cell(points, reference.size)
    before, after = common_cells(reference, now)
    if len(after) < _LEAST_CELLS:
        return None
    xy = (reference.xy[before] + now.xy[after]) / 2.0
    turned = interaction_matrix(xy, now.z_m[after]) @ (basis.B[:, 3] * way.turned_rad)
    flow = now.error[after] - reference.error[before] - turned
    # Other features of a cell are seen now, and their error is another one by its slope.
    slope = weighted_slope(reference.xy_goal, reference.error, reference.weight)
    flow -= (now.xy_goal[after] - reference.xy_goal[before]) @ slope
    weight = np.minimum(reference.weight[before], now.weight[after])
    L = interaction_matrix(xy, np.ones(len(xy)))
    along = np.einsum("nij,jk->kni", L, basis.B[:, :3] @ _courses(way.moved_m))
    left = _unexplained(flow, weight, along, L @ _tilt(basis))
    best = int(np.argmin(left))
    elsewhere = np.roll(_COSINES, best) <= _ELSEWHERE
    return float(_COSINES[best]) if left[elsewhere].min() > _CLEARLY * left[best] else None


def _courses(moved_m: FloatArray) -> FloatArray:
    """Ways (3, K) as long as the vehicle's own and with its climb, all around."""
    angle = np.arange(len(_COSINES)) * math.tau / len(_COSINES)
    forward, right, down = moved_m
    c, s = np.cos(angle), np.sin(angle)
    return np.stack([c * forward - s * right, s * forward + c * right, np.full_like(c, down)])


def _tilt(basis: MotionBasis) -> FloatArray:
    """Twists (6, 2) of the camera: roll and pitch of the body."""
    tilt = np.zeros((6, 2))
    tilt[3:] = basis.B[:3, :2]
    return tilt


def _unexplained(
    flow: FloatArray, weight: FloatArray, along: FloatArray, tilt: FloatArray
) -> FloatArray:
    """Mean square (K,) of what each course leaves of the flow, whatever depth and tilt are.

    Parameters
    ----------
    flow, weight : FloatArray
        How features have moved (N, 2), and how much they count (N,).
    along : FloatArray
        Where courses would move them (K, N, 2): as far as their depth says, but not backwards.
    tilt : FloatArray
        Where roll and pitch would (N, 2, 2), the last axis.
    """
    along = along / np.maximum(np.linalg.norm(along, axis=2, keepdims=True), 1e-12)
    across = np.stack([-along[..., 1], along[..., 0]], axis=-1)
    is_ahead = counts = np.ones(along.shape[:2], np.bool_)
    for _ in range(_ROUNDS):
        tilted = _fitted_tilt(flow, weight * counts, (across, is_ahead), tilt)
        rest = flow - np.einsum("nij,kj->kni", tilt, tilted)
        ahead, aside = (rest * along).sum(axis=2), (rest * across).sum(axis=2)
        is_ahead = ahead > 0.0
        misfit = np.hypot(aside, np.where(is_ahead, 0.0, ahead))
        best = int(np.argmin((weight * counts * misfit**2).sum(axis=1)))
        limit = max(_OUTLIER * weighted_median(misfit[best], weight), _OUTLIER * _NOISE)
        counts = misfit < limit
    square = (weight * np.minimum(misfit, limit) ** 2).sum(axis=1) / weight.sum()
    return np.asarray(square + _NOISE**2, np.float64)


def _fitted_tilt(
    flow: FloatArray, weight: FloatArray, lines: tuple[FloatArray, BoolArray], tilt: FloatArray
) -> FloatArray:
    """Roll and pitch (K, 2) that leave least.

    A feature that moved ahead on its line is explained but across it; any other not at all.
    """
    across, is_ahead = lines
    on_line, off_line = weight * is_ahead, weight * ~is_ahead
    J = np.einsum("kni,nij->knj", across, tilt)
    y = np.einsum("kni,ni->kn", across, flow)
    A = np.einsum("kn,kni,knj->kij", on_line, J, J)
    A += np.einsum("kn,nli,nlj->kij", off_line, tilt, tilt)
    b = np.einsum("kn,kni,kn->ki", on_line, J, y)
    b += np.einsum("kn,nli,nl->ki", off_line, tilt, flow)
    A += 1e-9 * np.trace(A, axis1=1, axis2=2)[:, None, None] * np.eye(2) + 1e-12 * np.eye(2)
    return np.asarray(np.linalg.solve(A, b[..., None])[..., 0])
