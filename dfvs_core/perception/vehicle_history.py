"""Vehicle state history: attitude, velocity and displacement at recent times.

Frames are matched with the vehicle's state by time, so states are kept for a while and
interpolated. Displacement is the change of the position without its resets: where the position
changes by far more than the velocity explains, the velocity counts.
"""

from __future__ import annotations

import bisect
import operator
from dataclasses import dataclass
from typing import TypeVar

import numpy as np

from dfvs_core.errors import GeometryError
from dfvs_core.geometry.arrays import FloatArray
from dfvs_core.geometry.poses import euler_from_rotation, make_pose, rotation_from_euler, wrap_angle
from dfvs_core.messages.link import VehicleState

_NS = 1e-9
_TIME = operator.attrgetter("t_ns")

_KEEP_NS = 4_000_000_000
"""How long states are kept."""
_MAX_GAP_NS = 200_000_000
"""A time further than this from the nearest state is unknown."""

MixT = TypeVar("MixT", float, FloatArray)

_LEAST_RESET_M = 0.1
"""Change of the position between two states, beyond what the velocity explains, that is a reset."""


@dataclass(frozen=True, slots=True)
class Motion:
    """State of the vehicle at one instant.

    Parameters
    ----------
    t_ns : int
        Monotonic time.
    roll_rad, pitch_rad, yaw_rad : float
        Attitude, body (FRD) in world (NED); yaw is unwrapped.
    velocity_m_s : (3,)
        NED.
    displacement_m : (3,)
        NED, since the history began.
    yaw_rate_rad_s : float
        Over the last tenth of a second.
    """

    t_ns: int
    roll_rad: float
    pitch_rad: float
    yaw_rad: float
    velocity_m_s: FloatArray
    displacement_m: FloatArray
    yaw_rate_rad_s: float = 0.0

    @classmethod
    def at_rest(cls, roll_rad: float, pitch_rad: float) -> Motion:
        """Motion of a vehicle that stands still at the origin, heading north."""
        return cls(0, roll_rad, pitch_rad, 0.0, np.zeros(3), np.zeros(3))

    @classmethod
    def from_pose(
        cls,
        T_world_body: FloatArray,
        velocity_m_s: FloatArray,
        yaw_rate_rad_s: float = 0.0,
        t_ns: int = 0,
    ) -> Motion:
        """Motion of a body from its pose (4, 4) and velocity (3,) m/s, both in the world.

        Raises
        ------
        GeometryError
            If they have other shapes.

        Examples
        --------
        >>> import numpy as np
        >>> motion = Motion.from_pose(np.eye(4), np.array([0.1, 0.0, 0.0]))
        >>> motion.yaw_rad, motion.level_velocity().tolist()
        (0.0, [0.1, 0.0, 0.0, 0.0])
        """
        shapes = np.shape(T_world_body), np.shape(velocity_m_s)
        if shapes != ((4, 4), (3,)):
            raise GeometryError(f"pose and velocity of shapes {shapes}", "(4, 4) and (3,)")
        attitude = euler_from_rotation(T_world_body[:3, :3])
        return cls(t_ns, *attitude, velocity_m_s, T_world_body[:3, 3], yaw_rate_rad_s)

    def T_world_body(self) -> FloatArray:
        """Pose (4, 4) of the body, its origin where the history began."""
        R = rotation_from_euler(self.roll_rad, self.pitch_rad, self.yaw_rad)
        return make_pose(R, self.displacement_m)

    def level_velocity(self) -> FloatArray:
        """Forward, right, down in m/s and yaw rate in rad/s (4,) of the level body."""
        R_level_world = rotation_from_euler(0.0, 0.0, self.yaw_rad).T
        return np.append(R_level_world @ self.velocity_m_s, self.yaw_rate_rad_s)


class VehicleHistory:
    """Recent vehicle states, oldest first."""

    def __init__(self) -> None:
        self._states: list[Motion] = []
        self._position_m: FloatArray = np.zeros(3)

    def add(self, state: VehicleState) -> None:
        """Take in a state; one that is not newer than the last is dropped."""
        velocity = np.array(state.velocity_m_s)
        yaw, displacement = state.yaw_rad, np.zeros(3)
        if self._states:
            last = self._states[-1]
            if state.t_ns <= last.t_ns:
                return
            dt_s = (state.t_ns - last.t_ns) * _NS
            yaw = last.yaw_rad + wrap_angle(state.yaw_rad - last.yaw_rad)
            by_velocity = 0.5 * dt_s * (last.velocity_m_s + velocity)
            step = np.array(state.position_m) - self._position_m
            is_reset = float(np.linalg.norm(step - by_velocity)) > _LEAST_RESET_M
            displacement = last.displacement_m + (by_velocity if is_reset else step)
        self._position_m = np.array(state.position_m)
        self._states.append(
            Motion(state.t_ns, state.roll_rad, state.pitch_rad, yaw, velocity, displacement)
        )
        oldest = bisect.bisect_left(self._states, state.t_ns - _KEEP_NS, key=_TIME)
        del self._states[:oldest]

    def at(self, t_ns: int) -> Motion | None:
        """State at a time, interpolated, or carried on for a moment; None where unknown."""
        if len(self._states) < 2:
            return None
        i = bisect.bisect_left(self._states, t_ns, key=_TIME)
        i = min(max(i, 1), len(self._states) - 1)
        before, after = self._states[i - 1], self._states[i]
        nearest_ns = min(abs(t_ns - before.t_ns), abs(t_ns - after.t_ns))
        if nearest_ns > _MAX_GAP_NS or after.t_ns - before.t_ns > 2 * _MAX_GAP_NS:
            return None
        return self._interpolate(before, after, t_ns)

    def _interpolate(self, before: Motion, after: Motion, t_ns: int) -> Motion:
        between_ns = min(max(t_ns, before.t_ns), after.t_ns)
        share = (between_ns - before.t_ns) / (after.t_ns - before.t_ns)
        beyond_s = (t_ns - between_ns) * _NS  # two states may be a millisecond apart

        def mix(a: MixT, b: MixT) -> MixT:
            return a + share * (b - a)

        velocity_m_s = mix(before.velocity_m_s, after.velocity_m_s)
        yaw_rate_rad_s = self._yaw_rate(after.t_ns)
        return Motion(
            t_ns=t_ns,
            roll_rad=mix(before.roll_rad, after.roll_rad),
            pitch_rad=mix(before.pitch_rad, after.pitch_rad),
            yaw_rad=mix(before.yaw_rad, after.yaw_rad) + beyond_s * yaw_rate_rad_s,
            velocity_m_s=velocity_m_s,
            displacement_m=mix(before.displacement_m, after.displacement_m)
            + beyond_s * velocity_m_s,
            yaw_rate_rad_s=yaw_rate_rad_s,
        )

    def _yaw_rate(self, t_ns: int) -> float:
        """Yaw rate in rad/s over the tenth of a second that ends at t_ns."""
        last = bisect.bisect_right(self._states, t_ns, key=_TIME) - 1
        first = bisect.bisect_left(self._states, t_ns - 100_000_000, key=_TIME)
        first = min(first, last - 1)
        if first < 0:
            return 0.0
        a, b = self._states[first], self._states[last]
        return (b.yaw_rad - a.yaw_rad) / ((b.t_ns - a.t_ns) * _NS)
