"""Error model of PX4's state estimate, with named grades.

The velocity error of a horizontal axis is a second-order Gauss-Markov process, that of the
vertical axis a first-order one. The position error follows it as in an EKF that is corrected by
position measurements: de_p/dt = e_v - e_p / time, with a time for each direction. Attitude errors
are a constant bias plus a second-order Gauss-Markov process.
"""

import csv
import enum
import functools
import math
from dataclasses import dataclass, fields
from pathlib import Path

import numpy as np

from dfvs_core.errors import ConfigError
from dfvs_sim.dynamics.gauss_markov import FirstOrder, SecondOrder, normal_source


class EstimateGrade(enum.Enum):
    """How well the vehicle knows its own motion; the value is the name on the command line."""

    PERFECT = "perfect"
    LOW = "low"
    MEDIUM = "medium"
    HIGH = "high"


@dataclass(frozen=True, slots=True)
class EstimateErrors:
    """Standard deviations of the errors, and their correlation times in s.

    Velocity (m/s): ``velocity`` of each horizontal axis, ``climb`` of the vertical one, and
    ``jitter``, white noise on the horizontal axes. Position (m), besides what follows from the
    velocity: wander of the horizontal axes with ``velocity_time_s``, and constant offsets, drawn
    once a flight, of each horizontal axis and of the height. Attitude (degrees): wander and bias
    of roll and pitch, and of the heading, whose bias is drawn around ``heading_bias_mean_deg``.
    ``heading_reset_deg``, drawn around ``heading_reset_mean_deg``, is by how much the heading
    changes at its reset in flight; the errors above are those after it.
    """

    velocity_m_s: float = 0.0
    velocity_time_s: float = 1.0
    jitter_m_s: float = 0.0
    climb_m_s: float = 0.0
    climb_time_s: float = 1.8
    position_time_s: float = 0.65
    height_time_s: float = 0.7
    position_m: float = 0.0
    offset_m: float = 0.0
    height_offset_m: float = 0.0
    tilt_deg: float = 0.0
    tilt_bias_deg: float = 0.0
    tilt_time_s: float = 2.0
    heading_deg: float = 0.0
    heading_bias_deg: float = 0.0
    heading_bias_mean_deg: float = 0.0
    heading_time_s: float = 1.8
    heading_reset_deg: float = 0.0
    heading_reset_mean_deg: float = 0.0

    def __post_init__(self) -> None:
        """Refuse what is no size of an error.

        Raises
        ------
        ConfigError
            If a deviation is negative or a time not positive.
        """
        for name in (field.name for field in fields(self)):
            value = getattr(self, name)
            least = -math.inf if name.endswith("_mean_deg") else 0.0
            if not math.isfinite(value) or value < least or (value == 0.0 and "_time_" in name):
                raise ConfigError(f"{name} of the estimate's errors is {value}", "a size")


@functools.cache
def errors_of(grade: EstimateGrade) -> EstimateErrors:
    """Errors of a grade, fitted to flights of PX4 v1.17 at three scales of its sensor noise.

    What the table leaves out is as in ``EstimateErrors()``, which is perfect.
    """
    with Path(__file__).with_name("estimate_errors.csv").open(encoding="utf-8", newline="") as file:
        rows = list(csv.DictReader(file))
    sizes = {row["size"]: row.get(grade.value) for row in rows}
    return EstimateErrors(**{name: float(size) for name, size in sizes.items() if size})


class ErrorProcess:
    """Present errors (estimate minus truth) in NED: m, m/s, m/s² and rad; advanced by ``step``."""

    def __init__(self, errors: EstimateErrors, rng: np.random.Generator) -> None:
        normal = normal_source(rng)
        e = errors
        self._normal = normal
        self._jitter_m_s = e.jitter_m_s
        self._time_s = e.position_time_s, e.position_time_s, e.height_time_s
        self._north = SecondOrder(e.velocity_m_s, e.velocity_time_s, normal)
        self._east = SecondOrder(e.velocity_m_s, e.velocity_time_s, normal)
        self._down = FirstOrder(e.climb_m_s, e.climb_time_s, normal)
        tilt, heading = (e.tilt_deg, e.tilt_time_s), (e.heading_deg, e.heading_time_s)
        self._attitude = [
            SecondOrder(math.radians(deg), time_s, normal) for deg, time_s in (tilt, tilt, heading)
        ]
        self._bias = [math.radians(e.tilt_bias_deg) * normal() for _ in range(2)]
        heading_deg = e.heading_bias_mean_deg + e.heading_bias_deg * normal()
        self._bias.append(math.radians(heading_deg))
        self._offset = [size * normal() for size in (e.offset_m, e.offset_m, e.height_offset_m)]
        self._wander = [SecondOrder(e.position_m, e.velocity_time_s, normal) for _ in range(2)]
        velocity = self._north.value, self._east.value, self._down.value
        self._lag = [v * time_s for v, time_s in zip(velocity, self._time_s, strict=True)]
        self.position_m = [0.0, 0.0, 0.0]
        self.velocity_m_s = [0.0, 0.0, 0.0]
        self.acceleration_m_s2 = [0.0, 0.0, 0.0]
        self.attitude_rad = [0.0, 0.0, 0.0]
        self.step(0.0)

    def step(self, dt_s: float) -> None:
        """Advance by ``dt_s``."""
        north, east, down = self._north, self._east, self._down
        velocity = (north.step(dt_s), east.step(dt_s), down.step(dt_s))
        for i, lag in enumerate(self._lag):
            self._lag[i] = lag + (velocity[i] - lag / self._time_s[i]) * dt_s
            self.position_m[i] = self._offset[i] + self._lag[i]
        self.position_m[0] += self._wander[0].step(dt_s)
        self.position_m[1] += self._wander[1].step(dt_s)
        self.velocity_m_s[0] = velocity[0] + self._jitter_m_s * self._normal()
        self.velocity_m_s[1] = velocity[1] + self._jitter_m_s * self._normal()
        self.velocity_m_s[2] = velocity[2]
        self.acceleration_m_s2[0], self.acceleration_m_s2[1] = north.rate, east.rate
        for i, angle in enumerate(self._attitude):
            self.attitude_rad[i] = self._bias[i] + angle.step(dt_s)
