"""Photometric visual servoing: the grey levels themselves are the features.

Collewet and Marchand, "Photometric visual servoing", IEEE Transactions on Robotics 27(4), 2011.
Settings of the authors' own example in ViSP (``photometricVisualServoing.cpp``): interaction
matrix at the desired view, gain 30 at 0.04 s a frame. Damping is 0.01 for 90 frames and 0.0001
afterwards. It stops where the squared error is small, and after 400 frames.
"""

import cv2
import numpy as np

from dfvs_bench.methods.method import Decision, GoalObservation, Observation
from dfvs_core.geometry.arrays import Float32Array, FloatArray, ImageArray
from dfvs_core.geometry.interaction import interaction_matrix
from dfvs_core.geometry.poses import se3_exp

ITERATIONS = 400
_GAIN = 30.0 * 0.04
_DAMPING_FIRST, _DAMPING_LATER = 0.01, 0.0001
_DAMPED_FRAMES = 90
_INNER = (slice(10, -10),) * 2
"""Pixels off the border, as the reference implementation takes them."""
_SQUARED_ERROR_AT_GOAL = 10_000.0 / (320 * 240)
"""Mean squared error in grey levels squared: 10,000 in all at the example's image size."""

_AT_REST = 1e-5
_LONGEST_STEP = 0.5
"""Of a frame, m or rad."""


class PhotometricMethod:
    """Levenberg-Marquardt on ``I - I*`` with true depth at the goal."""

    def __init__(self, goal: GoalObservation) -> None:
        self._goal = _grey(goal.image)
        pixels = goal.camera.grid()[_INNER]
        z_m = goal.depth.z_m[_INNER].astype(np.float64).ravel()
        L_x = interaction_matrix(goal.camera.normalise(pixels.reshape(-1, 2)), z_m)
        gradient = _gradient(self._goal) * [goal.camera.fx, goal.camera.fy]
        # Brightness constancy: dI/dt = -grad(I) . dx/dt (Eq. (12) of the article).
        L = -np.einsum("ni,nij->nj", gradient, L_x)
        self._L = L * goal.depth.validity[_INNER].reshape(-1, 1)
        self._H = self._L.T @ self._L

    def decide(self, observation: Observation) -> Decision:
        """One step of Levenberg and Marquardt."""
        error = (_grey(observation.image) - self._goal)[_INNER].astype(np.float64).ravel()
        mean_squared = float(np.mean(error * error))
        damping = _DAMPING_FIRST if observation.index < _DAMPED_FRAMES else _DAMPING_LATER
        damped = self._H + damping * np.diag(np.diag(self._H))
        twist = -_GAIN * np.linalg.lstsq(damped, self._L.T @ error, rcond=None)[0]
        longest = float(np.abs(twist).max())
        # Far off, the model means nothing.
        step = twist if longest <= _LONGEST_STEP else twist * (_LONGEST_STEP / longest)
        at_goal = mean_squared < _SQUARED_ERROR_AT_GOAL or longest < _AT_REST
        return Decision(
            T_current_next=se3_exp(step),
            error=float(np.sqrt(mean_squared)),
            done=at_goal,
        )


def _grey(image: ImageArray) -> Float32Array:
    grey = cv2.cvtColor(image, cv2.COLOR_RGB2GRAY)
    return np.asarray(grey, dtype=np.float32)


def _gradient(grey: Float32Array) -> FloatArray:
    """Gradient (N, 2) per px of the inner pixels, by central differences of fourth order.

    ViSP smooths over seven pixels: that ends in the same places, but swings there and uses up all
    frames.
    """
    kernel_along = np.array([[1.0, -8.0, 0.0, 8.0, -1.0]]) / 12.0
    du = cv2.filter2D(grey, cv2.CV_32F, kernel_along)[_INNER]
    dv = cv2.filter2D(grey, cv2.CV_32F, kernel_along.T)[_INNER]
    return np.stack([du.ravel(), dv.ravel()], axis=1).astype(np.float64)
