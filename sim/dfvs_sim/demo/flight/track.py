"""The vehicle's true path during a flight, and what it comes to."""

import math
import threading
import time
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from dfvs_core.geometry.arrays import FloatArray
from dfvs_core.geometry.poses import pose_error

CONVERGED_M, CONVERGED_RAD = 0.05, math.radians(1.0)
"""Criterion of a flight: below them the camera is at the goal."""

_RATE_HZ = 20.0
_SETTLED_NS = 500_000_000


@dataclass(frozen=True, slots=True)
class TrackPoint:
    """Where the camera was: pose (4, 4) in the scene, and its error against the goal."""

    t_ns: int
    T_scene_camera: FloatArray
    error_m: float
    error_rad: float


class Track:
    """Samples the camera's pose at 20 Hz on a thread of its own.

    ``pose_at`` gives ``T_scene_camera`` (4, 4) at a monotonic time, None where unknown.
    """

    def __init__(
        self, pose_at: Callable[[int], FloatArray | None], T_scene_goal: FloatArray
    ) -> None:
        self._pose_at = pose_at
        self._T_scene_goal = T_scene_goal
        self.points: list[TrackPoint] = []

    def run(self, stop: threading.Event) -> None:
        """Sample until stopped."""
        while not stop.wait(1.0 / _RATE_HZ):
            t_ns = time.monotonic_ns()
            T = self._pose_at(t_ns)
            if T is not None:
                self.points.append(TrackPoint(t_ns, T, *pose_error(T, self._T_scene_goal)))

    def between(self, start_ns: int, end_ns: int) -> list[TrackPoint]:
        """Points of a span of time."""
        return [p for p in self.points if start_ns <= p.t_ns <= end_ns]


def meets_criterion(error_m: float, error_rad: float) -> bool:
    """Whether an error against the goal is within 5 cm and 1 degree."""
    return error_m < CONVERGED_M and error_rad < CONVERGED_RAD


def path_length_m(points: list[TrackPoint]) -> float:
    """Length of the path through the points."""
    if len(points) < 2:
        return 0.0
    positions = np.array([p.T_scene_camera[:3, 3] for p in points])
    return float(np.linalg.norm(np.diff(positions, axis=0), axis=1).sum())


def settled_error(points: list[TrackPoint]) -> tuple[float, float]:
    """Median distance in m and angle in rad over the last half second; NaN without points."""
    if not points:
        return math.nan, math.nan
    last = [p for p in points if p.t_ns >= points[-1].t_ns - _SETTLED_NS]
    return (
        float(np.median([p.error_m for p in last])),
        float(np.median([p.error_rad for p in last])),
    )
