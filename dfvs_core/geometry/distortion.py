"""Where OpenCV's radial-tangential distortion folds back over itself.

Up to there it can be inverted: each distorted point is the image of one ray alone. Beyond, two
rays share a pixel.
"""

from collections.abc import Sequence

import numpy as np

from dfvs_core.geometry.arrays import FloatArray

_STEP_DEG, _WIDEST_DEG = 0.25, 89.5
"""Angles from the optical axis at which the distortion is examined."""


def first_folds(distortion: Sequence[float], directions_rad: FloatArray) -> FloatArray:
    """Points at which the distortion folds first, going outwards from the optical axis.

    It folds where the determinant of its Jacobian is positive no longer. Without tangential
    coefficients, that is where the radial function stops rising.

    Parameters
    ----------
    distortion : sequence of float
        OpenCV's (k1, k2, p1, p2[, k3[, k4, k5, k6]]).
    directions_rad : (N,) float
        Directions in the image, from x towards y.

    Returns
    -------
    (M, 2) float
        Undistorted normalised coordinates, M <= N: nothing for a direction without a fold.
    """
    k1, k2, p1, p2, k3, k4, k5, k6 = (*distortion, *(0.0,) * (8 - len(distortion)))
    radii = np.tan(np.radians(np.arange(0.0, _WIDEST_DEG, _STEP_DEG)))[:, None]
    x, y = radii * np.cos(directions_rad), radii * np.sin(directions_rad)
    s = radii**2
    numerator = 1.0 + s * (k1 + s * (k2 + s * k3))
    denominator = 1.0 + s * (k4 + s * (k5 + s * k6))
    with np.errstate(divide="ignore", invalid="ignore"):  # a pole counts as a fold
        radial = numerator / denominator
        slope = k1 + s * (2.0 * k2 + s * 3.0 * k3) - radial * (k4 + s * (2.0 * k5 + s * 3.0 * k6))
        slope = slope / denominator
        J_xx = radial + 2.0 * x * x * slope + 2.0 * p1 * y + 6.0 * p2 * x
        J_yy = radial + 2.0 * y * y * slope + 6.0 * p1 * y + 2.0 * p2 * x
        J_xy = 2.0 * x * y * slope + 2.0 * p1 * x + 2.0 * p2 * y
        is_folded = ~(J_xx * J_yy - J_xy**2 > 0.0)
    (found,) = np.nonzero(is_folded.any(axis=0))
    last = is_folded.argmax(axis=0)[found] - 1
    return np.stack([x[last, found], y[last, found]], axis=-1)
