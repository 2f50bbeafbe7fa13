"""Check of the camera's mounting: the images must turn as the gyroscopes do.

A vehicle tilts whenever it accelerates. A camera that is mounted another way round than the
settings say sees that tilt about another axis. So the tilt increments of the images are regressed
on those of the attitude, as complex numbers ``roll + i pitch``: the slope is 1 for a camera that is
mounted as said, -1 for one that looks backwards, i or -i for one that looks aside. Neither
position nor velocity estimate is needed. Both signals are high-passed: flow by translation, which
changes slowly, looks like a turn as well.
"""

from __future__ import annotations

import cmath
import math
from dataclasses import dataclass

import numpy as np

from dfvs_core.arrays import FloatArray
from dfvs_core.depth.source import GoalLink
from dfvs_core.servo.interaction import interaction_matrix
from dfvs_core.servo.weights import NoiseScale, tukey_weights, weighted_slope

_MEMORY_S = 5.0
"""Time constant of the regression's forgetting."""

_HIGH_PASS_S = 0.2
"""Time constant of the high-pass of both signals."""

_LEAST_FRAMES = 15.0
"""Frames below which a regression says nothing."""

_LONGEST_STEP_S = 0.5
"""Time between two frames above which a tilt increment says nothing."""

_LEAST_CELLS = 30
_ROUNDS = 3
_NOISE = 5e-4
"""Expected error of a feature's shift, normalised units."""

_LEAST_SPREAD_RAD = 5e-4
"""Expected error of a tilt increment by the images."""

_WRONG_RAD = math.radians(75.0)
"""Angle about the vertical from which on a mounting is another one than the settings say."""

_AUTOCORRELATION = 2.0
"""Frames that count as one: errors of neighbouring increments are alike."""

MOST_SCORE = 99.0
"""Bound of the score."""


@dataclass(frozen=True, slots=True)
class SeenCells:
    """Where cells of the goal view are seen: cell (n,), rising, and normalised ``xy`` (n, 2)."""

    cell: FloatArray
    xy: FloatArray
    xy_goal: FloatArray


@dataclass(frozen=True, slots=True)
class MountingState:
    """Weighted sums of the regression; see :func:`mounting_score`.

    ``R_world_body`` (3, 3) and ``seen`` are of the last frame, taken at ``t_ns``. ``slow`` holds
    the low-passed tilt increments of gyroscopes and images, which the high-pass takes off.
    """

    t_ns: int
    R_world_body: FloatArray
    seen: SeenCells
    slow: tuple[complex, complex] = (0j, 0j)
    weight: float = 0.0
    gyro: complex = 0j
    image: complex = 0j
    gyro_sq: float = 0.0
    image_sq: float = 0.0
    product: complex = 0j


def seen_cells(xy: FloatArray, link: GoalLink) -> SeenCells:
    """Cells of the goal view that a frame shows, each in the mean of its points.

    ``xy`` (h, w, 2) are the normalised coordinates of the grid, as the camera sees it.
    """
    matched = link.cell >= 0
    cell, of_point = np.unique(link.cell[matched], return_inverse=True)
    count = np.maximum(np.bincount(of_point, minlength=len(cell)), 1)

    def mean(values: FloatArray) -> FloatArray:
        sums = [np.bincount(of_point, v, minlength=len(cell)) for v in values[matched].T]
        return np.asarray(np.stack(sums, axis=1) / count[:, None], np.float64)

    return SeenCells(cell.astype(np.float64), mean(xy), mean(link.xy_goal))


def follow_mounting(
    state: MountingState | None,
    now: MountingState,
    R_body_camera: FloatArray,
) -> MountingState:
    """State after a frame; ``now`` holds its time, attitude and cells.

    ``R_body_camera`` (3, 3) is the mounting that the settings tell.
    """
    if state is None:
        return now
    dt_s = (now.t_ns - state.t_ns) * 1e-9
    turned = _image_rotation(state.seen, now.seen)
    if turned is None or not 0.0 < dt_s <= _LONGEST_STEP_S:
        return _carried(state, now, 1.0)
    gyro = _tilt(_rotation_vector(state.R_world_body.T @ now.R_world_body))
    image = _tilt(R_body_camera @ turned)
    kept = _carried(state, now, math.exp(-dt_s / _MEMORY_S))
    share = 1.0 - math.exp(-dt_s / _HIGH_PASS_S)
    slow = (
        state.slow[0] + share * (gyro - state.slow[0]),
        state.slow[1] + share * (image - state.slow[1]),
    )
    gyro, image = gyro - slow[0], image - slow[1]
    return MountingState(
        now.t_ns,
        now.R_world_body,
        now.seen,
        slow=slow,
        weight=kept.weight + 1.0,
        gyro=kept.gyro + gyro,
        image=kept.image + image,
        gyro_sq=kept.gyro_sq + abs(gyro) ** 2,
        image_sq=kept.image_sq + abs(image) ** 2,
        product=kept.product + gyro.conjugate() * image,
    )


def _carried(state: MountingState, now: MountingState, share: float) -> MountingState:
    return MountingState(
        now.t_ns,
        now.R_world_body,
        now.seen,
        state.slow,
        share * state.weight,
        share * state.gyro,
        share * state.image,
        share * state.gyro_sq,
        share * state.image_sq,
        share * state.product,
    )


def mounting_score(state: MountingState | None) -> float | None:
    """Distance of the slope from the hypothesis that it refutes, in its standard deviations.

    Positive where the slope is nearer to 1, the mounting that the settings say: its distance from
    the nearest wrong one, which is a slope of length 1 turned by 75 degrees or more. Negative where
    it is nearer to a wrong one: its distance from 1. Near zero while the vehicle has not tilted
    enough; None while too few frames were seen.
    """
    if state is None or state.weight < _LEAST_FRAMES:
        return None
    n = state.weight
    spread_gyro = state.gyro_sq - abs(state.gyro) ** 2 / n
    spread_image = state.image_sq - abs(state.image) ** 2 / n
    product = state.product - state.gyro.conjugate() * state.image / n
    if spread_gyro <= 1e-12:
        return 0.0
    slope = product / spread_gyro
    left = max(spread_image - abs(product) ** 2 / spread_gyro, 0.0)
    variance = left / (n - 2.0) / 2.0 + _LEAST_SPREAD_RAD**2
    spread = math.sqrt(_AUTOCORRELATION * variance / spread_gyro)
    angle = max(abs(cmath.phase(slope)), _WRONG_RAD)
    from_wrong = abs(slope - cmath.rect(1.0, math.copysign(angle, slope.imag)))
    from_right = abs(slope - 1.0)
    score = from_wrong if from_right < from_wrong else -from_right
    return min(max(score / spread, -MOST_SCORE), MOST_SCORE)


def _image_rotation(before: SeenCells, now: SeenCells) -> FloatArray | None:
    """Rotation vector (3,) rad of the camera that best explains how the features have moved."""
    _, first, second = np.intersect1d(
        before.cell, now.cell, assume_unique=True, return_indices=True
    )
    if len(first) < _LEAST_CELLS:
        return None
    xy = now.xy[second]
    weight = np.ones(len(xy))
    # Other points of a cell are seen now: their image differs by its slope over the goal view.
    slope = weighted_slope(before.xy_goal[first], before.xy[first], weight)
    moved = now.xy_goal[second] - before.xy_goal[first]
    shift = xy - before.xy[first] - moved @ slope
    L = interaction_matrix(xy, np.ones(len(xy)))[:, :, 3:]
    rotation = np.zeros(3)
    for _ in range(_ROUNDS):
        rest = shift - L @ rotation
        weight = tukey_weights(np.linalg.norm(rest, axis=1), np.ones(len(xy)), NoiseScale(_NOISE))
        A = np.einsum("n,nij,nik->jk", weight, L, L) + 1e-9 * np.eye(3)
        rotation = np.linalg.solve(A, np.einsum("n,nij,ni->j", weight, L, shift))
    return rotation


def _rotation_vector(R: FloatArray) -> FloatArray:
    """Rotation vector (3,) of a small rotation (3, 3)."""
    return 0.5 * np.array([R[2, 1] - R[1, 2], R[0, 2] - R[2, 0], R[1, 0] - R[0, 1]])


def _tilt(vector: FloatArray) -> complex:
    """Roll and pitch of a rotation vector (3,) of the body."""
    return complex(float(vector[0]), float(vector[1]))
