"""The messages that the vehicle streams: its status, its estimate and, on request, the truth."""

import math
from collections.abc import Callable
from typing import Any

from pymavlink.dialects.v20 import development as mavlink

from dfvs_core.geometry.poses import rotation_from_euler
from dfvs_sim.vehicle.messages.earth import (
    attitude_quaternion,
    global_origin,
    global_position,
    true_state,
)
from dfvs_sim.vehicle.motion.flight import Flight
from dfvs_sim.vehicle.status import Status

Message = Any
"""A pymavlink message: pymavlink's classes are generated and carry no common type."""

_GYRO, _ACCEL, _MAG, _BARO, _GPS = 1, 2, 4, 8, 32
_ATTITUDE, _POSITION = 0x800 | 0x1000, 0x4000 | 0x2000
_MOTORS, _AHRS, _BATTERY, _PREARM = 0x8000, 0x200000, 0x2000000, 0x10000000
_LEVEL_ESTIMATES = 1 | 4 | 32
"""ESTIMATOR_STATUS: attitude, vertical velocity and height."""
_PLACE_ESTIMATES = 2 | 8 | 16
"""Horizontal velocity and position."""
_CLAIMED_M = 0.29, 0.1
"""Accuracy of the position that is told, horizontally and vertically, whatever it is."""
_SENSORS = _GYRO | _ACCEL | _MAG | _BARO | _GPS | _ATTITUDE | _POSITION | _MOTORS | _AHRS | _BATTERY


class Telemetry:
    """Builds each message from the status and the flight: its estimate, demand and true motion."""

    def __init__(self, status: Status, flight: Flight) -> None:
        self._status = status
        self._flight = flight
        self._e = flight.estimate
        self.builders: dict[str, Callable[[int], Message | None]] = {
            "HEARTBEAT": self._heartbeat,
            "CURRENT_MODE": self._current_mode,
            "ATTITUDE": self._attitude,
            "ATTITUDE_QUATERNION": self._attitude_quaternion,
            "GLOBAL_POSITION_INT": self._global_position,
            "LOCAL_POSITION_NED": self._local_position,
            "ODOMETRY": self._odometry,
            "GPS_RAW_INT": self._gps,
            "SYS_STATUS": self._sys_status,
            "EXTENDED_SYS_STATE": self._extended_sys_state,
            "SYSTEM_TIME": self._system_time,
            "HOME_POSITION": self._home_position,
            "BATTERY_STATUS": self._battery,
            "AUTOPILOT_VERSION": self._version,
            "ESTIMATOR_STATUS": self._estimator_status,
            "POSITION_TARGET_LOCAL_NED": self._position_target,
            "GPS_GLOBAL_ORIGIN": lambda now_ns: global_origin(self._us(now_ns)),
            "HIL_STATE_QUATERNION": lambda _: true_state(flight.vehicle),
        }

    def build(self, name: str, now_ns: int) -> Message | None:
        """Message of that name, None where it has nothing to say yet."""
        return self.builders[name](now_ns)

    def _ms(self, now_ns: int) -> int:
        return (now_ns - self._status.boot_ns) // 1_000_000

    def _us(self, now_ns: int) -> int:
        return (now_ns - self._status.boot_ns) // 1_000

    def _heartbeat(self, _: int) -> Message:
        s = self._status
        return mavlink.MAVLink_heartbeat_message(
            mavlink.MAV_TYPE_QUADROTOR,
            mavlink.MAV_AUTOPILOT_PX4,
            s.mode.base_mode(armed=s.armed),
            s.mode.custom_mode,
            s.system_status(),
            3,
        )

    def _current_mode(self, _: int) -> Message:
        s = self._status
        return mavlink.MAVLink_current_mode_message(
            mavlink.MAV_STANDARD_MODE_NON_STANDARD, s.mode.custom_mode, s.intended.custom_mode
        )

    def _attitude(self, now_ns: int) -> Message:
        e = self._e
        return mavlink.MAVLink_attitude_message(self._ms(now_ns), *e.attitude_rad, *e.rates_rad_s)

    def _attitude_quaternion(self, now_ns: int) -> Message:
        e = self._e
        q = attitude_quaternion(*e.attitude_rad)
        return mavlink.MAVLink_attitude_quaternion_message(self._ms(now_ns), *q, *e.rates_rad_s)

    def _local_position(self, now_ns: int) -> Message | None:
        e = self._e
        if not self._status.estimator_ok:
            return None
        return mavlink.MAVLink_local_position_ned_message(
            self._ms(now_ns), *e.position_m, *e.velocity_m_s
        )

    def _global_position(self, now_ns: int) -> Message | None:
        e = self._e
        if not (self._status.ready and self._status.estimator_ok):
            return None
        heading = round(math.degrees(e.yaw_rad) * 100) % 36000
        return mavlink.MAVLink_global_position_int_message(
            self._ms(now_ns),
            *global_position(e.position_m),
            round((self._status.home_m[2] - e.down_m) * 1000),
            *(round(speed * 100) for speed in e.velocity_m_s),
            heading,
        )

    def _odometry(self, now_ns: int) -> Message | None:
        e = self._e
        if not self._status.estimator_ok:
            return None
        unknown = [math.nan] * 21
        return mavlink.MAVLink_odometry_message(
            self._us(now_ns),
            mavlink.MAV_FRAME_LOCAL_NED,
            mavlink.MAV_FRAME_BODY_FRD,
            *e.position_m,
            attitude_quaternion(*e.attitude_rad),
            *(rotation_from_euler(*e.attitude_rad).T @ e.velocity_m_s).tolist(),
            *e.rates_rad_s,
            *(unknown, unknown),
            e.resets % 256,
            mavlink.MAV_ESTIMATOR_TYPE_AUTOPILOT,
            100,
        )

    def _gps(self, now_ns: int) -> Message:
        e = self._e
        fixed = self._status.estimator_ok
        return mavlink.MAVLink_gps_raw_int_message(
            self._us(now_ns),
            mavlink.GPS_FIX_TYPE_3D_FIX if fixed else mavlink.GPS_FIX_TYPE_NO_FIX,
            *global_position(e.position_m),
            70,
            100,
            round(100 * math.hypot(e.v_north_m_s, e.v_east_m_s)),
            65535,
            10 if fixed else 0,
        )

    def _estimator_status(self, now_ns: int) -> Message:
        flags = _LEVEL_ESTIMATES | (_PLACE_ESTIMATES if self._status.estimator_ok else 0)
        return mavlink.MAVLink_estimator_status_message(
            self._us(now_ns), flags, 0.1, 0.1, 0.1, 0.1, 0.0, 0.0, *_CLAIMED_M
        )

    def _position_target(self, now_ns: int) -> Message:
        """What the position controller flies, as PX4 limits it; what is not given is masked out."""
        demand = self._flight.demand
        yaws = (demand.yaw_rad, demand.yaw_rate_rad_s)
        values = (*demand.position, *self._flight.velocity_target, *demand.acceleration)
        mask = sum(1 << i for i, v in enumerate(values) if not math.isfinite(v))
        mask |= sum(1 << i for i, v in enumerate(yaws, start=10) if not math.isfinite(v))
        return mavlink.MAVLink_position_target_local_ned_message(
            self._ms(now_ns), mavlink.MAV_FRAME_LOCAL_NED, mask, *values, *yaws
        )

    def _sys_status(self, _: int) -> Message:
        s = self._status
        health = _SENSORS if s.ready else _SENSORS & ~(_GPS | _POSITION)
        if not s.estimator_ok:
            health &= ~(_GPS | _POSITION)
        if s.warns_of_estimate:
            health &= ~_AHRS
        # PX4 sets this bit in the health alone, and by the present mode.
        if s.can_arm:
            health |= _PREARM
        return mavlink.MAVLink_sys_status_message(
            _SENSORS,
            _SENSORS,
            health,
            200,
            round(1000 * _voltage(s.battery)),
            -1,
            math.floor(100 * s.battery),
            *[0] * 6,
        )

    def _battery(self, _: int) -> Message:
        s = self._status
        cells = [round(1000 * _voltage(s.battery) / 4)] * 4 + [65535] * 6
        return mavlink.MAVLink_battery_status_message(
            0, 0, 0, 32767, cells, -1, -1, -1, math.floor(100 * s.battery)
        )

    def _extended_sys_state(self, _: int) -> Message:
        return mavlink.MAVLink_extended_sys_state_message(0, self._status.landed_state())

    def _system_time(self, now_ns: int) -> Message:
        return mavlink.MAVLink_system_time_message(0, self._ms(now_ns))

    def _home_position(self, now_ns: int) -> Message | None:
        s = self._status
        if not s.ready:
            return None
        q = attitude_quaternion(0.0, 0.0, self._e.yaw_rad)
        return mavlink.MAVLink_home_position_message(
            *global_position(s.home_m), *s.home_m, q, 0.0, 0.0, 0.0, self._us(now_ns)
        )

    def _version(self, _: int) -> Message:
        capabilities = (
            mavlink.MAV_PROTOCOL_CAPABILITY_PARAM_ENCODE_BYTEWISE
            | mavlink.MAV_PROTOCOL_CAPABILITY_COMMAND_INT
            | mavlink.MAV_PROTOCOL_CAPABILITY_SET_POSITION_TARGET_LOCAL_NED
            | mavlink.MAV_PROTOCOL_CAPABILITY_MAVLINK2
        )
        version = 1 << 24 | 17 << 16 | 0 << 8 | 255
        none = [0] * 8
        return mavlink.MAVLink_autopilot_version_message(
            capabilities, version, 0, 0, 0, none, none, none, 0, 0, 0x44465653
        )


def _voltage(share: float) -> float:
    """Voltage of four cells, linear between empty and full."""
    return 4.0 * (3.5 + 0.55 * share)
