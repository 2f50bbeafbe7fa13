"""Mounting check: rotation in the images against the gyroscopes.

A vehicle tilts whenever it accelerates. A camera that is mounted another way round than the
settings say sees that tilt about another axis. So the tilt increments of the images, roll and
pitch, are regressed on those of the attitude. The slope (2, 2) is the identity for a camera that is
mounted as set. It is a rotation for one that is turned about the vertical, as one that looks
backwards. It has a sign turned for one that is upside down, or whose image is mirrored. Neither
position nor velocity estimate is needed.

Motion past the scene looks like a turn as well: nodding like rising, for one. So the images' turn
is found together with their translation, and every increment counts by its own covariance. Both
signals are high-passed: what is left of the translation changes slowly.
"""

import math
from dataclasses import dataclass, replace

import numpy as np

from dfvs_core.geometry.arrays import FloatArray
from dfvs_core.messages.link import MOUNTING_SCORE
from dfvs_core.servo.checks.image_turn import ImageTurn

_MEMORY_S = 5.0
"""Time constant of the regression's forgetting."""

_HIGH_PASS_S = 0.2
"""Time constant of the high-pass of both signals."""

_LEAST_FRAMES = 15.0
"""Frames below which a regression says nothing."""

_LONGEST_STEP_S = 0.5
"""Time between two frames above which a tilt increment says nothing."""

_LEAST_SPREAD_RAD = 2e-4
"""Expected error of a tilt increment by the images."""

_GYRO_NOISE_RAD = 2e-5
"""Noise of a tilt increment by the gyroscopes, about each axis: that of the best small ones."""

_LEAST_INFORMATION = 4.0 * (_GYRO_NOISE_RAD / _LEAST_SPREAD_RAD) ** 2
"""Trace of the information in each frame below which there is not even that noise."""

_SLOPES: tuple[tuple[FloatArray, FloatArray, FloatArray], ...] = (
    (
        np.array([[1.0, 0.0], [0.0, -1.0], [0.0, 1.0], [1.0, 0.0]]),
        np.array([1.0, 0.0]),
        np.array([[math.cos(a), math.sin(a)] for a in np.radians(np.arange(75.0, 286.0, 5.0))]),
    ),
    (
        np.array([[1.0, 0.0], [0.0, 0.0], [0.0, 0.0], [0.0, 1.0]]),
        np.array([1.0, 1.0]),
        np.array([[1.0, -1.0], [-1.0, 1.0]]),
    ),
)
"""Two families of slopes, a turn about the vertical (cosine, sine) and a factor of each axis: the
slope (4,), row by row, for either parameter, and the parameters of right and wrong mountings."""

_LEAST_MISFIT = 0.5
"""Least variance of the increments over what is stated for them: a few frames may fit too well."""

_MOST_OFF = 0.5
"""Distance from all of these at which a slope fits none: the images or the attitude are poor."""

_PROBE_NS = 500_000_000
_PROBE_M_S = 0.3
"""Time, and speed about either axis, of each motion while the mounting is undecided."""

MOST_SCORE = 99.0
"""Bound of the score."""


@dataclass(frozen=True, slots=True)
class MountingState:
    """Weighted normal equations of the regression; see :func:`mounting_score`.

    ``R_world_body`` (3, 3) is of the last frame, taken at ``t_ns``. ``slow`` (2, 2) holds the
    low-passed tilt increments of gyroscopes and images, which the high-pass takes off. The slope
    (4,), row by row, solves ``information @ slope = vector``; ``square`` is the images' own part.
    """

    t_ns: int
    R_world_body: FloatArray
    slow: FloatArray
    information: FloatArray
    vector: FloatArray
    square: float = 0.0
    frames: float = 0.0


def begin_mounting(t_ns: int, R_world_body: FloatArray) -> MountingState:
    """State that knows nothing, at a first frame."""
    return MountingState(t_ns, R_world_body, np.zeros((2, 2)), np.zeros((4, 4)), np.zeros(4))


def follow_mounting(
    state: MountingState, now: MountingState, turn: ImageTurn | None, R_body_camera: FloatArray
) -> MountingState:
    """State after a frame.

    Parameters
    ----------
    state, now : MountingState
        Before, and of this frame's time and attitude.
    turn : ImageTurn or None
        Turn of the camera since then by the images.
    R_body_camera : (3, 3)
        Mounting by the settings.
    """
    dt_s = (now.t_ns - state.t_ns) * 1e-9
    here = replace(state, t_ns=now.t_ns, R_world_body=now.R_world_body)
    if turn is None or not 0.0 < dt_s <= _LONGEST_STEP_S:
        return here
    gyro = _rotation_vector(state.R_world_body.T @ now.R_world_body)[:2]
    image = (R_body_camera @ turn.vector_rad)[:2]
    share = 1.0 - math.exp(-dt_s / _HIGH_PASS_S)
    slow = state.slow + share * (np.stack([gyro, image]) - state.slow)
    gyro, image = gyro - slow[0], image - slow[1]
    covariance = (R_body_camera @ turn.covariance @ R_body_camera.T)[:2, :2]
    weight = np.linalg.inv(covariance + np.eye(2) * _LEAST_SPREAD_RAD**2)
    G = np.kron(np.eye(2), gyro)
    kept = math.exp(-dt_s / _MEMORY_S)
    return replace(
        here,
        slow=slow,
        information=kept * state.information + G.T @ weight @ G,
        vector=kept * state.vector + G.T @ weight @ image,
        square=kept * state.square + float(image @ weight @ image),
        frames=kept * state.frames + 1.0,
    )


def mounting_score(state: MountingState | None) -> float | None:
    """How clearly the slope tells a right mounting from a wrong one, in its standard deviations.

    It is fitted as a turn about the vertical, and as a factor of each axis; of the wrong mountings
    of each the nearest counts. The score is twice the logarithm of the likelihood ratio over the
    distance between the two: plus that distance where the slope is the right one, minus that
    distance where it is the wrong one, 0 half way. A slope that fits neither, such as 0, decides
    nothing. The lesser of both scores counts: a camera is mounted right if it is in no way wrong.
    None while too few frames were seen, or the attitude does not even tell noise: nobody told it.
    """
    if state is None or state.frames < _LEAST_FRAMES:
        return None
    if np.trace(state.information) < _LEAST_INFORMATION * state.frames:
        return None
    score = min(_score(state, *family) for family in _SLOPES)
    return min(max(score, -MOST_SCORE), MOST_SCORE)


def _score(state: MountingState, family: FloatArray, right: FloatArray, wrong: FloatArray) -> float:
    """Score by slopes of one family (4, 2), from the parameters of right and wrong mountings."""
    H = family.T @ state.information @ family + 1e-9 * np.eye(2)
    vector = family.T @ state.vector
    found = np.linalg.solve(H, vector)
    misfit = (state.square - float(vector @ found)) / (2.0 * state.frames - 2.0)
    H = H / max(misfit, _LEAST_MISFIT)

    def square(off: FloatArray) -> float:
        return max(float(off @ H @ off), 0.0)

    nearest = min(wrong, key=lambda mounted: square(found - mounted))
    if min(np.linalg.norm(found - mounted) for mounted in (right, nearest)) > _MOST_OFF:
        return 0.0
    apart = math.sqrt(square(right - nearest))
    return (square(found - nearest) - square(found - right)) / max(apart, 1e-9)


def probing_velocity(score: float | None, t_ns: int, velocity: FloatArray) -> FloatArray:
    """Velocity (4,) of a vehicle, diagonal while its mounting is undecided: that tilts it.

    Ahead to the right and back to the left in turn, which is about both axes; in every fourth half
    second the ``velocity`` of the law. The gate scales it to the reduced speed.
    """
    phase = t_ns // _PROBE_NS % 4
    if score is None or abs(score) >= MOUNTING_SCORE or phase == 0:
        return velocity
    diagonal = np.zeros_like(velocity)
    diagonal[:2] = _PROBE_M_S if phase % 2 else -_PROBE_M_S
    return diagonal


def _rotation_vector(R: FloatArray) -> FloatArray:
    """Rotation vector (3,) of a small rotation (3, 3)."""
    return 0.5 * np.array([R[2, 1] - R[1, 2], R[0, 2] - R[2, 0], R[1, 0] - R[0, 1]])
