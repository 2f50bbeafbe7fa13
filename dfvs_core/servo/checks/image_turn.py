"""Camera rotation between two frames, from the flow of both to the goal.

A point of the scene keeps its place ``g`` in the goal image. With ``g(p)`` of each frame, ``p``
moves by ``u`` so that ``g_now(p + u) = g_before(p)``: to first order ``J u = g_before - g_now`` at
each point of the grid, where ``J`` is the slope of ``g``. And ``u`` is ``L`` times the camera's
twist.
"""

from dataclasses import dataclass

import numpy as np

from dfvs_core.geometry.arrays import BoolArray, FloatArray
from dfvs_core.geometry.camera import CameraModel
from dfvs_core.geometry.interaction import interaction_matrix
from dfvs_core.geometry.robust_weights import NoiseScale, tukey_weights
from dfvs_core.servo.law import normal_equations
from dfvs_core.servo.points import GridSamples

_LEAST_POINTS = 50
_ROUNDS = 3
_DAMPING = 1e-9
_NOISE = 5e-4
"""Expected error of a point's shift, normalised units."""

_MOST_BEND = 0.5
"""Relative change of the slope from one side of a point to the other that is no edge of depth."""

_POINTS_ALIKE = 9.0
"""Points of the grid that count as one: errors of neighbours are alike."""

_TURN_OF_MOTION = 0.2
"""Expected error of the turn, as a share of the points' shift by the translation."""


@dataclass(frozen=True, slots=True)
class ImageTurn:
    """Rotation vector (3,) rad of the camera between two frames, and its covariance (3, 3)."""

    vector_rad: FloatArray
    covariance: FloatArray


@dataclass(frozen=True, slots=True)
class PointTracks:
    """N points that two frames share.

    ``xy`` (N, 2) are their normalised coordinates in the current image and ``z`` (N,) their depth
    in any unit. ``shift`` (N, 2) is how far the goal image's point at ``xy`` has moved from the
    earlier frame to this one, with the sign turned, and ``slope`` (N, 2, 2) the change of that
    point for a change of ``xy``.
    """

    xy: FloatArray
    z: FloatArray
    shift: FloatArray
    slope: FloatArray


def point_tracks(
    samples: tuple[GridSamples, GridSamples],
    z: FloatArray,
    cameras: tuple[CameraModel, CameraModel],
    min_confidence: float,
) -> PointTracks:
    """Points that an earlier frame and this one share.

    ``samples`` are of both, ``z`` (h, w) is the depth of this one, ``cameras`` are the vehicle's
    and the goal's.
    """
    before, now = samples
    camera, goal_camera = cameras
    g_before, g_now = (goal_camera.normalise(s.pixels + s.flow) for s in samples)
    mean = 0.5 * (g_before + g_now)
    xy = camera.normalise(now.pixels)
    confident = np.minimum(before.confidence, now.confidence) > min_confidence
    keep = _with_neighbours(confident) & _is_smooth(mean)
    slope = _by_cell(mean)[keep] @ np.linalg.inv(_by_cell(xy)[keep])
    return PointTracks(xy[keep], z[keep], (g_before - g_now)[keep], slope)


def _by_cell(points: FloatArray) -> FloatArray:
    """Change (h, w, 2, 2) of points (h, w, 2) for one cell of the grid to the right and down."""
    return np.stack([np.gradient(points, axis=1), np.gradient(points, axis=0)], axis=-1)


def _is_smooth(g: FloatArray) -> BoolArray:
    """Points (h, w) where ``g`` (h, w, 2) changes alike to either side: not at an edge of depth."""
    smooth = np.zeros(g.shape[:2], np.bool_)
    across = _bend(g[1:-1, :-2], g[1:-1, 1:-1], g[1:-1, 2:])
    down = _bend(g[:-2, 1:-1], g[1:-1, 1:-1], g[2:, 1:-1])
    smooth[1:-1, 1:-1] = np.maximum(across, down) < _MOST_BEND
    return smooth


def _bend(a: FloatArray, b: FloatArray, c: FloatArray) -> FloatArray:
    """Change of the step from a to b and from b to c, over the mean step."""
    bend = 2.0 * np.linalg.norm(a - 2.0 * b + c, axis=-1)
    return np.asarray(bend / np.maximum(np.linalg.norm(c - a, axis=-1), 1e-9), np.float64)


def _with_neighbours(confident: BoolArray) -> BoolArray:
    """Points (h, w) whose four neighbours are confident as well."""
    padded = np.pad(confident, 1, mode="edge")
    across = padded[1:-1, :-2] & padded[1:-1, 2:]
    return confident & across & padded[:-2, 1:-1] & padded[2:, 1:-1]


def image_turn(tracks: PointTracks) -> ImageTurn | None:
    """Turn of the camera that best explains how points have moved, None where they are few.

    The translation is solved for beside it. A wrong depth takes part of that for a turn, which the
    covariance counts.
    """
    if len(tracks.xy) < _LEAST_POINTS:
        return None
    by_twist = interaction_matrix(tracks.xy, tracks.z)
    L = tracks.slope @ by_twist
    twist, rest = np.zeros(6), np.linalg.norm(tracks.shift, axis=1)
    for _ in range(_ROUNDS):
        weight = tukey_weights(rest, np.ones(len(rest)), NoiseScale(_NOISE))
        equations = normal_equations(L, -tracks.shift, weight)
        twist = equations.solve(_DAMPING)
        rest = np.linalg.norm(tracks.shift - L @ twist, axis=1)
    total = float(weight.sum())
    variance = max(float(weight @ rest**2) / (2.0 * total), _NOISE**2)
    information = total * equations.A + _DAMPING * np.eye(6)
    covariance = _POINTS_ALIKE * variance * np.linalg.inv(information)[3:, 3:]
    moved = float(np.median(np.linalg.norm(by_twist[:, :, :3] @ twist[:3], axis=1)))
    return ImageTurn(twist[3:], covariance + np.eye(3) * (_TURN_OF_MOTION * moved) ** 2)
