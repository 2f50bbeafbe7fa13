"""Which earlier frame the current one is compared with for depth from motion."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from dfvs_core.arrays import FloatArray

_WANTED_PARALLAX = 0.04
"""Baseline over depth at which a correspondence of 0.5 px gives depth to a few per cent."""

_LEAST_PARALLAX = 0.01
_MOST_TURN_RAD = 0.35


def choose_earlier(
    poses: Sequence[FloatArray], T_world_camera: FloatArray, depth_m: float
) -> int | None:
    """Index of the frame to triangulate against, or None if all are too near or too turned.

    Parameters
    ----------
    poses : sequence of (4, 4)
        ``T_world_camera`` of the frames at hand, oldest first.
    T_world_camera : (4, 4)
        Of the current frame.
    depth_m : float
        Median depth of the scene, as far as it is known.

    Returns
    -------
    int or None
        The newest frame whose baseline suffices; else the one with the longest baseline.
    """
    best, best_baseline = None, _LEAST_PARALLAX * depth_m
    for i in reversed(range(len(poses))):
        turn = poses[i][:3, :3].T @ T_world_camera[:3, :3]
        if np.trace(turn) < 1.0 + 2.0 * np.cos(_MOST_TURN_RAD):
            continue
        baseline = float(np.linalg.norm(poses[i][:3, 3] - T_world_camera[:3, 3]))
        if baseline >= _WANTED_PARALLAX * depth_m:
            return i
        if baseline > best_baseline:
            best, best_baseline = i, baseline
    return best
