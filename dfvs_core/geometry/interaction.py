"""Interaction matrix of point features."""

import numpy as np

from dfvs_core.geometry.arrays import FloatArray


def interaction_matrix(xy: FloatArray, z_m: FloatArray) -> FloatArray:
    """Interaction matrix L of normalised image points (DFVS Eq. (1), L(z)).

    Parameters
    ----------
    xy : (N, 2) float64
        Normalised image coordinates.
    z_m : (N,) float64
        Depth along the optical axis, m, positive.

    Returns
    -------
    (N, 2, 6) float64
        ``d(xy)/dt = L @ (v, w)`` for the camera's twist in its own frame (m/s, rad/s).
    """
    x, y = xy[:, 0], xy[:, 1]
    rho = 1.0 / z_m
    L = np.zeros((len(z_m), 2, 6))
    L[:, 0, 0] = -rho
    L[:, 0, 2] = x * rho
    L[:, 0, 3] = x * y
    L[:, 0, 4] = -(1.0 + x * x)
    L[:, 0, 5] = y
    L[:, 1, 1] = -rho
    L[:, 1, 2] = y * rho
    L[:, 1, 3] = 1.0 + y * y
    L[:, 1, 4] = -x * y
    L[:, 1, 5] = -x
    return L
