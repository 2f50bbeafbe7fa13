"""Odometry of the benchmark's free camera: exact, or with the errors of a vehicle's estimate."""

from dataclasses import dataclass

import numpy as np

from dfvs_core.geometry.arrays import FloatArray
from dfvs_core.geometry.poses import make_pose, so3_exp
from dfvs_core.perception.vehicle_history import Motion
from dfvs_sim.dynamics.estimate_errors import ERRORS, ErrorProcess, EstimateGrade

_STEP_S = 0.02
_SEED = 20
"""Errors are the same for every method and scene: they are compared with each other."""


@dataclass(frozen=True, slots=True)
class CameraMotion:
    """True pose (4, 4) of a camera in the world, and its velocity (3,) there, m/s."""

    T_world_camera: FloatArray
    velocity_m_s: FloatArray


class Odometry:
    """Turns the true motion into what the vehicle's estimate says of it.

    Parameters
    ----------
    grade : EstimateGrade
        Size of the errors.
    period_s : float
        Time between two frames.
    """

    def __init__(self, grade: EstimateGrade, period_s: float) -> None:
        self._errors = ErrorProcess(ERRORS[grade], np.random.default_rng(_SEED))
        self._steps = max(1, round(period_s / _STEP_S))
        self._step_s = period_s / self._steps

    @property
    def velocity_error_m_s(self) -> FloatArray:
        """Estimated minus true velocity (3,), in the world.

        A camera that is controlled by the estimate moves by as much less than it was asked to.
        """
        return np.array(self._errors.velocity_m_s)

    def estimate(self, motion: CameraMotion, t_ns: int) -> Motion:
        """Advance by one frame; the camera is the body."""
        for _ in range(self._steps):
            self._errors.step(self._step_s)
        turn = so3_exp(np.array(self._errors.attitude_rad))
        position = motion.T_world_camera[:3, 3] + np.array(self._errors.position_m)
        T = make_pose(turn @ motion.T_world_camera[:3, :3], position)
        velocity = motion.velocity_m_s + self.velocity_error_m_s
        return Motion.from_pose(T, velocity, t_ns=t_ns)
