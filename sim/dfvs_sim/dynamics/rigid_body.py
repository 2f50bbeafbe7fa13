"""A quadrotor's motion: a point mass that must tilt to accelerate, on flat ground.

Plain floats throughout: the model runs 250 times a second beside everything else. World frame
NED (m, m/s, m/s²), body FRD, aerospace angles in rad. The parameters were fitted to step responses
recorded with PX4 v1.17's own quadrotor model; ``tests/unit/vehicle/test_dynamics.py`` has them.
"""

import math
from dataclasses import dataclass

from dfvs_core.geometry.poses import wrap_angle

Vector = tuple[float, float, float]

GRAVITY_M_S2 = 9.80665
DRAG_1_S = 0.88
"""Drag, linear in the velocity through the air, per unit of mass."""
TILT_MAX_RAD = math.radians(45.0)
_THRUST_MAX_M_S2, _THRUST_LAG_S = 2.0 * GRAVITY_M_S2, 0.028
_ATTITUDE_GAIN_1_S, _RATE_GAIN_1_S = 6.5, 10.7
"""From an error of the tilt to a rate, and from one of the rate to an angular acceleration."""
_YAW_RATE_GAIN_1_S, _YAW_INTEGRAL_GAIN_1_S2, _YAW_LAG_S = 2.44, 0.63, 0.084
"""Proportional and integral gain of the yaw rate, and the lag of the rotors behind them."""


@dataclass(slots=True)
class MotionState:
    """Motion of a vehicle, true or estimated, in the local frame; body rates are in rad/s."""

    north_m: float = 0.0
    east_m: float = 0.0
    down_m: float = 0.0
    v_north_m_s: float = 0.0
    v_east_m_s: float = 0.0
    v_down_m_s: float = 0.0
    a_north_m_s2: float = 0.0
    a_east_m_s2: float = 0.0
    a_down_m_s2: float = 0.0
    roll_rad: float = 0.0
    pitch_rad: float = 0.0
    yaw_rad: float = 0.0
    roll_rate_rad_s: float = 0.0
    pitch_rate_rad_s: float = 0.0
    yaw_rate_rad_s: float = 0.0
    on_ground: bool = True

    @property
    def position_m(self) -> Vector:
        """North, east, down."""
        return self.north_m, self.east_m, self.down_m

    @property
    def velocity_m_s(self) -> Vector:
        """Towards north, east, down."""
        return self.v_north_m_s, self.v_east_m_s, self.v_down_m_s

    @property
    def acceleration_m_s2(self) -> Vector:
        """Towards north, east, down."""
        return self.a_north_m_s2, self.a_east_m_s2, self.a_down_m_s2

    @property
    def attitude_rad(self) -> Vector:
        """Roll, pitch, yaw."""
        return self.roll_rad, self.pitch_rad, self.yaw_rad

    @property
    def rates_rad_s(self) -> Vector:
        """About the body's axes."""
        return self.roll_rate_rad_s, self.pitch_rate_rad_s, self.yaw_rate_rad_s


@dataclass(frozen=True, slots=True)
class Command:
    """What the autopilot asks of the airframe: acceleration in NED and a yaw rate."""

    north_m_s2: float = 0.0
    east_m_s2: float = 0.0
    down_m_s2: float = 0.0
    yaw_rate_rad_s: float = 0.0


class Quadrotor(MotionState):
    """State of the vehicle in NED, with the origin of the local frame; advanced by ``step``.

    It starts on the flat ground, which has a down coordinate in m, with a heading in rad. The
    attitude loop acts on the estimated attitude: the true one plus ``attitude_error_rad``
    (roll, pitch and yaw), so that the true tilt and the direction of thrust are off by it.
    """

    def __init__(self, ground_m: float = 0.0, yaw_rad: float = 0.0) -> None:
        super().__init__(down_m=ground_m, yaw_rad=yaw_rad)
        self.ground_m = ground_m
        self.wind_north_m_s, self.wind_east_m_s = 0.0, 0.0
        self.attitude_error_rad = (0.0, 0.0, 0.0)
        self._thrust_m_s2 = 0.0
        self._yaw_torque_rad_s2 = 0.0
        self._yaw_integral_rad_s2 = 0.0

    def step(self, dt_s: float, command: Command | None) -> None:
        """Advance by dt_s; ``None`` means that the rotors stand still."""
        self._turn(dt_s, command or Command(), spinning=command is not None)
        self._push(dt_s)
        self._touch_ground()

    def _turn(self, dt_s: float, command: Command, *, spinning: bool) -> None:
        """Run the attitude, yaw-rate and thrust loops."""
        thrust, roll, pitch = self._attitude_for(command) if spinning else (0.0, 0.0, 0.0)
        self._thrust_m_s2 += (thrust - self._thrust_m_s2) * min(1.0, dt_s / _THRUST_LAG_S)
        if self.on_ground:
            roll = pitch = 0.0
        else:
            roll, pitch = roll - self.attitude_error_rad[0], pitch - self.attitude_error_rad[1]
        for_roll = _ATTITUDE_GAIN_1_S * (roll - self.roll_rad)
        for_pitch = _ATTITUDE_GAIN_1_S * (pitch - self.pitch_rad)
        self.roll_rate_rad_s += _RATE_GAIN_1_S * (for_roll - self.roll_rate_rad_s) * dt_s
        self.pitch_rate_rad_s += _RATE_GAIN_1_S * (for_pitch - self.pitch_rate_rad_s) * dt_s
        self.roll_rad += self.roll_rate_rad_s * dt_s
        self.pitch_rad += self.pitch_rate_rad_s * dt_s
        self._turn_yaw(dt_s, command.yaw_rate_rad_s)

    def _turn_yaw(self, dt_s: float, yaw_rate_rad_s: float) -> None:
        """Yaw-rate loop: proportional and integral, then the lag of the rotors."""
        if self.on_ground:
            self.yaw_rate_rad_s = self._yaw_torque_rad_s2 = self._yaw_integral_rad_s2 = 0.0
            return
        error = yaw_rate_rad_s - self.yaw_rate_rad_s
        self._yaw_integral_rad_s2 += _YAW_INTEGRAL_GAIN_1_S2 * error * dt_s
        wanted = _YAW_RATE_GAIN_1_S * error + self._yaw_integral_rad_s2
        self._yaw_torque_rad_s2 += (wanted - self._yaw_torque_rad_s2) * dt_s / _YAW_LAG_S
        self.yaw_rate_rad_s += self._yaw_torque_rad_s2 * dt_s
        yaw = self.yaw_rad + self.yaw_rate_rad_s * dt_s
        self.yaw_rad = wrap_angle(yaw)

    def _attitude_for(self, command: Command) -> tuple[float, float, float]:
        """Specific thrust (m/s²), roll and pitch (rad) that give the commanded acceleration."""
        heading = self.yaw_rad + self.attitude_error_rad[2]
        c, s = math.cos(heading), math.sin(heading)
        forward = c * command.north_m_s2 + s * command.east_m_s2
        right = -s * command.north_m_s2 + c * command.east_m_s2
        up = max(0.1 * GRAVITY_M_S2, GRAVITY_M_S2 - command.down_m_s2)
        most = up * math.tan(TILT_MAX_RAD)
        level = math.hypot(forward, right)
        if level > most:
            forward, right = forward * most / level, right * most / level
        pitch = math.atan2(-forward, up)
        roll = math.atan2(right, math.hypot(up, forward))
        thrust = math.sqrt(forward * forward + right * right + up * up)
        return min(thrust, _THRUST_MAX_M_S2), roll, pitch

    def _push(self, dt_s: float) -> None:
        """Thrust along the body's z, drag and gravity move the point mass."""
        k = DRAG_1_S
        cr, sr = math.cos(self.roll_rad), math.sin(self.roll_rad)
        cp, sp = math.cos(self.pitch_rad), math.sin(self.pitch_rad)
        cy, sy = math.cos(self.yaw_rad), math.sin(self.yaw_rad)
        f = self._thrust_m_s2
        wind_n, wind_e = self.wind_north_m_s, self.wind_east_m_s
        self.a_north_m_s2 = -f * (cr * sp * cy + sr * sy) - k * (self.v_north_m_s - wind_n)
        self.a_east_m_s2 = -f * (cr * sp * sy - sr * cy) - k * (self.v_east_m_s - wind_e)
        self.a_down_m_s2 = GRAVITY_M_S2 - f * cr * cp - k * self.v_down_m_s
        self.v_north_m_s += self.a_north_m_s2 * dt_s
        self.v_east_m_s += self.a_east_m_s2 * dt_s
        self.v_down_m_s += self.a_down_m_s2 * dt_s
        self.north_m += self.v_north_m_s * dt_s
        self.east_m += self.v_east_m_s * dt_s
        self.down_m += self.v_down_m_s * dt_s

    def _touch_ground(self) -> None:
        """Stop at the ground and stick to it until the thrust lifts the vehicle."""
        self.on_ground = self.down_m >= self.ground_m
        if not self.on_ground:
            return
        self.down_m = self.ground_m
        self.v_north_m_s = self.v_east_m_s = 0.0
        self.v_down_m_s = min(0.0, self.v_down_m_s)
        self.a_north_m_s2 = self.a_east_m_s2 = self.a_down_m_s2 = 0.0
