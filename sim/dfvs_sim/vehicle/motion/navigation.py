"""What each mode that needs no setpoints asks of the position loop.

Hold brakes along a profile with limited acceleration and jerk, and then keeps the place where it
came to rest; take-off, return and landing fly the same profiles towards their targets.
"""

import math
from dataclasses import dataclass

from dfvs_sim.dynamics.control import Demand
from dfvs_sim.dynamics.estimator import Estimate
from dfvs_sim.dynamics.rigid_body import GRAVITY_M_S2
from dfvs_sim.vehicle.modes import Mode
from dfvs_sim.vehicle.parameters import ParameterTable
from dfvs_sim.vehicle.status import Status

_ARRIVED_M = 0.3


@dataclass(frozen=True, slots=True)
class Sticks:
    """MANUAL_CONTROL, each axis from -1 to 1: forward, right, up and yaw to the right."""

    forward: float = 0.0
    right: float = 0.0
    up: float = 0.0
    yaw: float = 0.0


class _SmoothAxis:
    """Position, velocity and acceleration of one axis on its way to a velocity."""

    __slots__ = ("acceleration", "position", "velocity")

    def __init__(self, position: float = 0.0, velocity: float = 0.0) -> None:
        self.position = position
        self.velocity = velocity
        self.acceleration = 0.0

    def approach(self, dt_s: float, velocity: float, acceleration: float, jerk: float) -> None:
        """Advance by dt_s towards ``velocity`` within the limits on acceleration and jerk."""
        missing = velocity - self.velocity
        fastest = math.sqrt(2.0 * jerk * abs(missing))
        wanted = math.copysign(min(acceleration, fastest), missing)
        change = jerk * dt_s
        self.acceleration += min(change, max(-change, wanted - self.acceleration))
        if abs(missing) <= 2.0 * jerk * dt_s * dt_s:
            self.velocity, self.acceleration = velocity, 0.0
        self.velocity += self.acceleration * dt_s
        self.position += self.velocity * dt_s


class Navigator:
    """Profiles on the three axes and the targets that they go to."""

    def __init__(self, parameters: ParameterTable, status: Status) -> None:
        self._parameters = parameters
        self._status = status
        self._axes = [_SmoothAxis() for _ in range(3)]
        self._target: list[float | None] = [None, None, None]
        self._yaw_rad = 0.0
        self._climbing = False
        self._over_home = False
        self.sticks = Sticks()
        self.takeoff_down_m: float | None = None
        self.climb_limit_m_s = 0.0

    def enter(self, mode: Mode, estimate: Estimate, previous: Mode) -> None:
        """Start the mode from the vehicle's present motion."""
        if previous is Mode.TAKEOFF and mode is Mode.HOLD:
            return
        e = estimate
        self._axes = [_SmoothAxis(*axis) for axis in zip(e.position_m, e.velocity_m_s, strict=True)]
        self._target = [None, None, None]
        self._yaw_rad = e.yaw_rad
        self._climbing = self._over_home = False
        if mode is Mode.TAKEOFF:
            default = e.down_m - self._parameters["MIS_TAKEOFF_ALT"]
            wanted = self.takeoff_down_m if self.takeoff_down_m is not None else default
            self._target = [e.north_m, e.east_m, min(wanted, e.down_m)]
            self.takeoff_down_m = None
        if mode is Mode.RETURN:
            self._target[2] = self._return_down(e)
            self._climbing = True

    def shift_heading(self, change_rad: float) -> None:
        """Shift the heading that is held along with a reset of the estimated one."""
        self._yaw_rad += change_rad

    def demand(self, dt_s: float, mode: Mode, estimate: Estimate) -> Demand:
        """Advance the mode's profiles by dt_s and say what they ask for."""
        if mode is Mode.RETURN:
            self._return_home(estimate)
        if mode in (Mode.STABILIZED, Mode.ALTITUDE, Mode.MANUAL):
            return self._tilt_by_sticks(dt_s, mode)
        if mode is Mode.POSITION:
            self._fly_by_sticks(dt_s, estimate)
        else:
            self._fly_to_target(dt_s, mode, estimate)
        north, east, down = self._axes
        return Demand(
            (north.position, east.position, down.position),
            (north.velocity, east.velocity, down.velocity),
            (north.acceleration, east.acceleration, down.acceleration),
            self._yaw_rad,
        )

    def takeoff_reached(self, estimate: Estimate) -> bool:
        """Whether take-off is over: PX4 hands over to Hold near the target already."""
        target = self._target[2]
        near = self._parameters["NAV_MC_ALT_RAD"]
        return target is not None and estimate.down_m - target < min(near, _ARRIVED_M)

    def _fly_to_target(self, dt_s: float, mode: Mode, estimate: Estimate) -> None:
        """Advance towards the target, where there is one, else brake to rest."""
        p = self._parameters
        acceleration, jerk = self._smoothness()
        north, east, down = self._axes
        for axis, speed in zip((north, east), self._level_speeds(acceleration, jerk), strict=True):
            axis.approach(dt_s, speed, acceleration, jerk)
        if mode is Mode.LAND or self._over_home:
            wanted = self._landing_speed(estimate)
        elif self._target[2] is not None:
            error = self._target[2] - down.position
            climb = self.climb_limit_m_s if mode is Mode.TAKEOFF else p["MPC_Z_V_AUTO_UP"]
            limit = climb if error < 0.0 else p["MPC_Z_V_AUTO_DN"]
            wanted = math.copysign(min(limit, _speed_to_stop_in(abs(error), 3.0, jerk)), error)
        else:
            wanted = 0.0
        down.approach(dt_s, wanted, acceleration, jerk)

    def _smoothness(self) -> tuple[float, float]:
        """Limits on acceleration and jerk; whatever the parameters are set to."""
        p = self._parameters
        return max(0.1, float(p["MPC_ACC_HOR"])), max(0.1, float(p["MPC_JERK_AUTO"]))

    def _level_speeds(self, acceleration: float, jerk: float) -> tuple[float, float]:
        """North and east speed towards the target; zero where there is none."""
        target_north, target_east = self._target[0], self._target[1]
        if target_north is None or target_east is None:
            return 0.0, 0.0
        d_north = target_north - self._axes[0].position
        d_east = target_east - self._axes[1].position
        distance = math.hypot(d_north, d_east)
        if distance < 1e-6:
            return 0.0, 0.0
        speed = min(
            self._parameters["MPC_XY_CRUISE"], _speed_to_stop_in(distance, acceleration, jerk)
        )
        return speed * d_north / distance, speed * d_east / distance

    def _landing_speed(self, estimate: Estimate) -> float:
        """Speed of descent: slower below two heights, slowest near the ground."""
        p = self._parameters
        height = self._status.home_m[2] - estimate.down_m
        if height < p["MPC_LAND_ALT3"]:
            return float(p["MPC_LAND_CRWL"])
        band = max(0.1, p["MPC_LAND_ALT1"] - p["MPC_LAND_ALT2"])
        share = (height - p["MPC_LAND_ALT2"]) / band
        slow, fast = p["MPC_LAND_SPEED"], p["MPC_Z_V_AUTO_DN"]
        return float(slow + min(1.0, max(0.0, share)) * (fast - slow))

    def _return_down(self, estimate: Estimate) -> float:
        """Down coordinate of the way home: the return altitude, less where home is close."""
        p = self._parameters
        home = self._status.home_m
        distance = math.hypot(estimate.north_m - home[0], estimate.east_m - home[1])
        cone = p["RTL_RETURN_ALT"] if distance > p["RTL_MIN_DIST"] else distance
        return min(estimate.down_m, home[2] - cone)

    def _return_home(self, estimate: Estimate) -> None:
        """Climb first, then fly home, then descend onto it."""
        home = self._status.home_m
        if self._climbing:
            target = self._target[2]
            self._climbing = target is not None and estimate.down_m - target > _ARRIVED_M
            return
        self._target[0], self._target[1] = home[0], home[1]
        distance = math.hypot(estimate.north_m - home[0], estimate.east_m - home[1])
        if distance < _ARRIVED_M:
            self._over_home = True

    def _fly_by_sticks(self, dt_s: float, estimate: Estimate) -> None:
        """POSCTL: sticks are velocities in the heading's frame, centred sticks hold the place."""
        p, s = self._parameters, self.sticks
        self._yaw_rad += s.yaw * math.radians(p["MPC_MAN_Y_MAX"]) * dt_s
        c, sine = math.cos(estimate.yaw_rad), math.sin(estimate.yaw_rad)
        speed = p["MPC_VEL_MANUAL"]
        north = speed * (c * s.forward - sine * s.right)
        east = speed * (sine * s.forward + c * s.right)
        climb = p["MPC_Z_VEL_MAX_UP"] if s.up > 0.0 else p["MPC_Z_VEL_MAX_DN"]
        wanted = (north, east, -s.up * climb)
        for axis, velocity in zip(self._axes, wanted, strict=True):
            axis.approach(dt_s, velocity, *self._smoothness())

    def _tilt_by_sticks(self, dt_s: float, mode: Mode) -> Demand:
        """ALTCTL and STABILIZED: sticks tilt; the place is nobody's business but the pilot's."""
        p, s = self._parameters, self.sticks
        tilt = GRAVITY_M_S2 * math.tan(math.radians(p["MPC_MAN_TILT_MAX"]))
        self._yaw_rad += s.yaw * math.radians(p["MPC_MAN_Y_MAX"]) * dt_s
        c, sine = math.cos(self._yaw_rad), math.sin(self._yaw_rad)
        north = tilt * (c * s.forward - sine * s.right)
        east = tilt * (sine * s.forward + c * s.right)
        down = self._axes[2]
        if mode is not Mode.ALTITUDE:
            up = GRAVITY_M_S2 * s.up
            return Demand(acceleration=(north, east, -up), yaw_rad=self._yaw_rad)
        climb = p["MPC_Z_VEL_MAX_UP"] if s.up > 0.0 else p["MPC_Z_VEL_MAX_DN"]
        down.approach(dt_s, -s.up * climb, *self._smoothness())
        nan = math.nan
        return Demand(
            (nan, nan, down.position), (nan, nan, down.velocity), (north, east, 0.0), self._yaw_rad
        )


def _speed_to_stop_in(distance: float, acceleration: float, jerk: float) -> float:
    """Highest speed from which the profile stops within the distance (PX4's formula)."""
    b = 4.0 * acceleration * acceleration / jerk
    return 0.5 * (-b + math.sqrt(b * b + 8.0 * acceleration * max(0.0, distance)))
