"""Servo law: weighted, damped least squares on the interaction matrix (DFVS Eq. (1)).

Eq. (1) as printed lacks L transposed in front of the error; what is solved here is
``u = -(L^T W L + mu diag(L^T W L))^-1 L^T W e`` with e = s - s*.
"""

from dataclasses import dataclass

import numpy as np

from dfvs_core.geometry.arrays import FloatArray
from dfvs_core.geometry.interaction import interaction_matrix
from dfvs_core.servo.freedom import MotionBasis
from dfvs_core.servo.points import ServoPoints


@dataclass(frozen=True, slots=True)
class NormalEquations:
    """``A = J^T W J / sum(W)`` (d, d) and ``b = J^T W r / sum(W)`` (d,) of a weighted problem."""

    A: FloatArray
    b: FloatArray

    @property
    def condition(self) -> float:
        """Condition number of A with its columns scaled to unit length (unit-free)."""
        scale = np.sqrt(np.diag(self.A))
        if not (np.isfinite(scale).all() and (scale > 0).all()):
            return float("inf")
        eigenvalues = np.linalg.eigvalsh(self.A / np.outer(scale, scale))
        if eigenvalues[0] <= 0:
            return float("inf")
        return float(eigenvalues[-1] / eigenvalues[0])

    def solve(self, damping: float) -> FloatArray:
        """Levenberg-Marquardt step (d,): ``-(A + mu diag(A))^-1 b``; zero where A is singular."""
        damped = self.A + damping * np.diag(np.diag(self.A))
        try:
            step = -np.asarray(np.linalg.solve(damped, self.b), dtype=np.float64)
        except np.linalg.LinAlgError:
            return np.zeros(len(self.b))
        return step if np.isfinite(step).all() else np.zeros(len(self.b))


def normal_equations(J: FloatArray, residual: FloatArray, weight: FloatArray) -> NormalEquations:
    """Normal equations of ``min sum_i w_i |J_i u + r_i|^2``.

    Parameters
    ----------
    J : (N, 2, d)
    residual : (N, 2)
    weight : (N,)
    """
    total = max(float(weight.sum()), 1e-12)
    d = J.shape[2]
    weighted = (J * weight[:, None, None]).reshape(-1, d)
    flat = J.reshape(-1, d)
    return NormalEquations(flat.T @ weighted / total, weighted.T @ residual.reshape(-1) / total)


def servo_motion(
    points: ServoPoints, basis: MotionBasis, z_goal_m: FloatArray | None, damping: float
) -> tuple[FloatArray, NormalEquations]:
    """Motion (d,) (m, rad) that the law asks for at gain 1, with its normal equations.

    Parameters
    ----------
    points : ServoPoints
        Correspondences in the frame in which the basis lives.
    basis : MotionBasis
        Degrees of freedom.
    z_goal_m : (N,) or None
        Depth of the points in the goal view: the law then uses the mean of the Jacobians at the
        current view and at the goal (Malis 2004), which is second-order exact. None: the
        current one alone.
    damping : float
        mu of Eq. (1).
    """
    L = interaction_matrix(points.xy, points.z_m)
    if z_goal_m is not None:
        L = 0.5 * (L + interaction_matrix(points.xy_goal, z_goal_m))
    equations = normal_equations(L @ basis.B, points.error, points.weight)
    return equations.solve(damping), equations
