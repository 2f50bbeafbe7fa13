"""The autopilot's position and velocity loops: a demand becomes an acceleration and a yaw rate.

As in PX4: position error times a gain is added to the velocity demand, velocity error goes
through proportional, integral and derivative gains; the commanded acceleration is then followed
by the attitude loop. NED, SI units.
"""

import math
from collections import deque
from dataclasses import dataclass, replace

from dfvs_core.geometry.poses import wrap_angle
from dfvs_sim.dynamics.estimator import Estimate
from dfvs_sim.dynamics.rigid_body import GRAVITY_M_S2, Command, Vector

NAN_VECTOR: Vector = (math.nan, math.nan, math.nan)


@dataclass(frozen=True, slots=True)
class Demand:
    """What a flight mode asks for; NaN on an axis means that the axis is not given.

    Position (m), velocity (m/s) and acceleration (m/s²) in NED; heading (rad) and yaw rate
    (rad/s). Without heading and yaw rate the heading is held.
    """

    position: Vector = NAN_VECTOR
    velocity: Vector = NAN_VECTOR
    acceleration: Vector = NAN_VECTOR
    yaw_rad: float = math.nan
    yaw_rate_rad_s: float = math.nan


@dataclass(frozen=True, slots=True)
class Gains:
    """PX4's default gains and limits (MPC_*, MC_YAW*), and the delay from demand to action."""

    delay_s: float = 0.055
    xy_position: float = 0.95
    z_position: float = 1.0
    xy_velocity: float = 1.8
    xy_integral: float = 0.4
    xy_derivative: float = 0.2
    z_velocity: float = 4.4
    z_integral: float = 2.0
    yaw: float = 2.8
    speed_xy_m_s: float = 12.0
    speed_up_m_s: float = 3.0
    speed_down_m_s: float = 1.5
    tilt_max_rad: float = math.radians(45.0)
    yaw_rate_max_rad_s: float = math.radians(200.0)


class Controller:
    """Cascaded loops with their integrators and the transport delay of demands."""

    def __init__(self, gains: Gains | None = None) -> None:
        self.gains = gains or Gains()
        self._integral = [0.0, 0.0, 0.0]
        self._queue: deque[tuple[float, Demand]] = deque()
        self._time_s = 0.0
        self._active = Demand()
        self.climb_limit_m_s = math.inf

    def reset(self) -> None:
        """Forget integrators and demands, as on take-off."""
        self._integral = [0.0, 0.0, 0.0]
        self._queue.clear()
        self._active = Demand()

    def shift_heading(self, change_rad: float) -> None:
        """Shift the headings that are demanded along with a reset of the estimated one."""
        self._active = _shifted(self._active, change_rad)
        self._queue = deque((at_s, _shifted(d, change_rad)) for at_s, d in self._queue)

    def update(self, dt_s: float, demand: Demand, vehicle: Estimate) -> Command:
        """Acceleration and yaw rate for this step; the demand acts after the delay."""
        self._time_s += dt_s
        latest = self._queue[-1][1] if self._queue else self._active
        if demand is not latest:
            self._queue.append((self._time_s + self.gains.delay_s, demand))
        while self._queue and self._queue[0][0] <= self._time_s:
            self._active = self._queue.popleft()[1]
        wanted = self._velocity(self._active, vehicle.position_m)
        acceleration = self._acceleration(dt_s, self._active, wanted, vehicle)
        return Command(*acceleration, self._yaw_rate(self._active, vehicle.yaw_rad))

    def _velocity(self, demand: Demand, position: Vector) -> Vector:
        """Velocity demand with the position loop added, limited; NaN where nothing is given."""
        g = self.gains
        north, east, down = (
            _add(demand.velocity[i], gain * (demand.position[i] - position[i]))
            for i, gain in enumerate((g.xy_position, g.xy_position, g.z_position))
        )
        return self.limited((north, east, down))

    def limited(self, velocity: Vector) -> Vector:
        """Velocity within the limits of speed, its direction over ground kept."""
        g, (north, east, down) = self.gains, velocity
        speed = math.hypot(north, east)
        if speed > g.speed_xy_m_s:
            north, east = north * g.speed_xy_m_s / speed, east * g.speed_xy_m_s / speed
        if down == down:
            down = min(g.speed_down_m_s, max(-min(g.speed_up_m_s, self.climb_limit_m_s), down))
        return north, east, down

    def _acceleration(
        self, dt_s: float, demand: Demand, wanted: Vector, vehicle: Estimate
    ) -> Vector:
        """Velocity loop on each axis, with the integrator stopped where the tilt saturates."""
        g = self.gains
        velocity, measured = vehicle.velocity_m_s, vehicle.acceleration_m_s2
        p = (g.xy_velocity, g.xy_velocity, g.z_velocity)
        d = (g.xy_derivative, g.xy_derivative, 0.0)
        out = [0.0, 0.0, 0.0]
        errors = [0.0, 0.0, 0.0]
        for i in range(3):
            given = demand.acceleration[i]
            out[i] = given if given == given else 0.0
            if wanted[i] == wanted[i]:
                errors[i] = wanted[i] - velocity[i]
                out[i] += p[i] * errors[i] + self._integral[i] - d[i] * measured[i]
        limit = (GRAVITY_M_S2 - out[2]) * math.tan(g.tilt_max_rad)
        if math.hypot(out[0], out[1]) < limit and not vehicle.on_ground:
            self._integral[0] += g.xy_integral * errors[0] * dt_s
            self._integral[1] += g.xy_integral * errors[1] * dt_s
        if not vehicle.on_ground:
            self._integral[2] += g.z_integral * errors[2] * dt_s
        return out[0], out[1], out[2]

    def _yaw_rate(self, demand: Demand, yaw_rad: float) -> float:
        """Yaw rate: the demanded one plus the heading loop, limited; zero if neither is given."""
        g = self.gains
        rate = demand.yaw_rate_rad_s if demand.yaw_rate_rad_s == demand.yaw_rate_rad_s else 0.0
        if demand.yaw_rad == demand.yaw_rad:
            error = wrap_angle(demand.yaw_rad - yaw_rad)
            rate += g.yaw * error
        return min(g.yaw_rate_max_rad_s, max(-g.yaw_rate_max_rad_s, rate))


def _shifted(demand: Demand, change_rad: float) -> Demand:
    """Demand of another heading; NaN, which asks for none, stays NaN."""
    return replace(demand, yaw_rad=wrap_angle(demand.yaw_rad + change_rad))


def _add(velocity: float, correction: float) -> float:
    """Sum of what is given of the two; NaN where neither is."""
    if velocity != velocity:
        return correction
    return velocity + correction if correction == correction else velocity
