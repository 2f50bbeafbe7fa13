"""Conversion of PX4's MAVLink messages to the gate's events."""

import math
from collections.abc import Mapping
from typing import Any

from dfvs_core.gate.events import (
    Attitude,
    Battery,
    CurrentMode,
    EstimatorState,
    ForeignSetpoint,
    Health,
    Heartbeat,
    LandedState,
    LocalPosition,
    ModeRequest,
    VehicleEvent,
    VehicleMode,
    VelocityTarget,
)
from dfvs_core.gate.limits import BodyVelocity

_ARMED_FLAG = 128
_CUSTOM_MODE_FLAG = 1
_POSCTL = 3
_AUTO = 4

_MODES = {
    1: VehicleMode.MANUAL,
    2: VehicleMode.ALTITUDE,
    6: VehicleMode.OFFBOARD,
    7: VehicleMode.MANUAL,
}
_SUB_MODES = {
    _POSCTL: {0: VehicleMode.POSITION, 2: VehicleMode.POSITION},
    _AUTO: {
        2: VehicleMode.TAKEOFF,
        3: VehicleMode.HOLD,
        4: VehicleMode.MISSION,
        5: VehicleMode.RETURN,
        6: VehicleMode.LAND,
    },
}
"""Main modes whose sub mode counts. POSCTL's are Position, Orbit (1) and Position slow (2)."""
_MODE_NUMBERS = {ModeRequest.OFFBOARD: (6, 0), ModeRequest.HOLD: (_AUTO, 3)}

_FAILSAFE_STATUS = (5, 6, 8)

_ESTIMATE = 0x200000
"""MAV_SYS_STATUS_AHRS: PX4 clears it for errors and for warnings about its local position."""
_SENSORS = {
    0x1: "gyroscope",
    0x2: "accelerometer",
    0x4: "magnetometer",
    _ESTIMATE: "attitude and position estimate",
}
_PREARM_CHECK = 0x10000000
"""Set in ``health`` alone, where the present mode can be armed (PX4 from 1.13 on)."""
_ESTIMATES = {1: "attitude", 2: "horizontal velocity", 4: "vertical velocity"}
_GLOBAL_POSITION_FLAG = 16
_POSITION_FLAGS = 8 | _GLOBAL_POSITION_FLAG

_BODY_NED = 8
_VELOCITY_AND_YAW_RATE = 0x5C7
_DO_SET_MODE = 176
_SET_MESSAGE_INTERVAL = 511

_POSITION_IGNORED = 1 | 2 | 4
_VELOCITY_IGNORED = 8 | 16 | 32

MESSAGE_INTERVALS_US = {31: 10_000, 32: 20_000, 85: 50_000, 230: 50_000, 436: 50_000}
"""ATTITUDE_QUATERNION at 100 Hz, LOCAL_POSITION_NED at 50 Hz, POSITION_TARGET_LOCAL_NED and
ESTIMATOR_STATUS at 20 Hz, CURRENT_MODE within 50 ms of a change."""

FOREIGN_SETPOINTS = (
    "SET_POSITION_TARGET_LOCAL_NED",
    "SET_POSITION_TARGET_GLOBAL_INT",
    "SET_ATTITUDE_TARGET",
)
"""Messages that only a commander sends; the autopilot forwards them where it joins links."""


def mode_of(custom_mode: int) -> VehicleMode:
    """Flight mode that a heartbeat's custom_mode spells: ``main << 16 | sub << 24``."""
    main, sub = custom_mode >> 16 & 0xFF, custom_mode >> 24 & 0xFF
    if main in _SUB_MODES:
        return _SUB_MODES[main].get(sub, VehicleMode.OTHER)
    return _MODES.get(main, VehicleMode.OTHER)


def heartbeat(t_ns: int, fields: Mapping[str, Any]) -> Heartbeat:
    """Event of HEARTBEAT."""
    return Heartbeat(
        t_ns,
        mode_of(int(fields["custom_mode"])),
        armed=bool(int(fields["base_mode"]) & _ARMED_FLAG),
        failsafe=int(fields["system_status"]) in _FAILSAFE_STATUS,
    )


def current_mode(t_ns: int, fields: Mapping[str, Any]) -> CurrentMode:
    """Event of CURRENT_MODE."""
    return CurrentMode(t_ns, mode_of(int(fields["custom_mode"])))


def attitude(t_ns: int, fields: Mapping[str, Any]) -> Attitude:
    """Event of ATTITUDE_QUATERNION."""
    w, x, y, z = (_number(fields[name]) for name in ("q1", "q2", "q3", "q4"))
    roll = math.atan2(2 * (w * x + y * z), 1 - 2 * (x * x + y * y))
    sine = 2 * (w * y - z * x)
    pitch = math.asin(min(max(sine, -1.0), 1.0)) if math.isfinite(sine) else math.nan
    yaw = math.atan2(2 * (w * z + x * y), 1 - 2 * (y * y + z * z))
    return Attitude(t_ns, roll, pitch, yaw)


def local_position(t_ns: int, fields: Mapping[str, Any]) -> LocalPosition:
    """Event of LOCAL_POSITION_NED."""
    x, y, z, vx, vy, vz = (_number(fields[name]) for name in ("x", "y", "z", "vx", "vy", "vz"))
    return LocalPosition(t_ns, (x, y, z), (vx, vy, vz))


def landed_state(t_ns: int, fields: Mapping[str, Any]) -> LandedState:
    """Event of EXTENDED_SYS_STATE."""
    landed = int(fields["landed_state"])
    return LandedState(t_ns, in_air=landed == 2, on_ground=landed == 1)


def system_status(t_ns: int, fields: Mapping[str, Any]) -> tuple[VehicleEvent, ...]:
    """Events of SYS_STATUS: battery and health."""
    percent = int(fields["battery_remaining"])
    remaining = percent / 100 if 0 <= percent <= 100 else None
    healthy = int(fields["onboard_control_sensors_health"])
    missing = int(fields["onboard_control_sensors_enabled"]) & ~healthy
    faults = {bit: name for bit, name in _SENSORS.items() if missing & bit}
    detail = f"not healthy: {', '.join(faults.values())}" if faults else ""
    can_arm = bool(healthy & _PREARM_CHECK)
    health = Health(t_ns, not faults, detail, can_arm, only_estimate=faults.keys() == {_ESTIMATE})
    return Battery(t_ns, remaining), health


def estimator_status(t_ns: int, fields: Mapping[str, Any]) -> EstimatorState:
    """Event of ESTIMATOR_STATUS."""
    flags = int(fields["flags"])
    missing = [name for bit, name in _ESTIMATES.items() if not flags & bit]
    if not flags & _POSITION_FLAGS:
        missing.append("horizontal position")
    detail = f"no {', '.join(missing)}" if missing else ""
    return EstimatorState(t_ns, not missing, detail, bool(flags & _GLOBAL_POSITION_FLAG))


def velocity_target(t_ns: int, fields: Mapping[str, Any]) -> VelocityTarget | None:
    """Event of POSITION_TARGET_LOCAL_NED, None where the autopilot flies to a position."""
    mask = int(fields["type_mask"])
    if mask & _POSITION_IGNORED != _POSITION_IGNORED or mask & _VELOCITY_IGNORED:
        return None
    vx, vy, vz = (_number(fields[name]) for name in ("vx", "vy", "vz"))
    return VelocityTarget(t_ns, (vx, vy, vz))


def foreign_setpoint(
    t_ns: int, name: str, sender: tuple[int, int], fields: Mapping[str, Any], system_id: int
) -> ForeignSetpoint | None:
    """Event of a setpoint from (system, component), None where it is for another vehicle."""
    if int(fields.get("target_system", 0)) not in (0, system_id):
        return None
    return ForeignSetpoint(t_ns, f"{name} of system {sender[0]}, component {sender[1]}")


def velocity_fields(velocity: BodyVelocity, system_id: int, time_boot_ms: int) -> dict[str, Any]:
    """Fields of SET_POSITION_TARGET_LOCAL_NED for a body velocity and yaw rate."""
    # MAVSDK takes a float given for an integer field as 0, so these are Python ints.
    return {
        "time_boot_ms": time_boot_ms,
        "target_system": system_id,
        "target_component": 1,
        "coordinate_frame": _BODY_NED,
        "type_mask": _VELOCITY_AND_YAW_RATE,
        **dict.fromkeys(("x", "y", "z", "afx", "afy", "afz", "yaw"), 0.0),
        "vx": velocity.forward_m_s,
        "vy": velocity.right_m_s,
        "vz": velocity.down_m_s,
        "yaw_rate": velocity.yaw_rad_s,
    }


def mode_fields(request: ModeRequest, system_id: int) -> dict[str, Any]:
    """Fields of COMMAND_LONG that ask for a mode; the flag for arming is never in it."""
    main, sub = _MODE_NUMBERS[request]
    return _command(_DO_SET_MODE, system_id, (float(_CUSTOM_MODE_FLAG), float(main), float(sub)))


def interval_fields(message_id: int, interval_us: int, system_id: int) -> dict[str, Any]:
    """Fields of COMMAND_LONG that ask for a message at an interval."""
    return _command(_SET_MESSAGE_INTERVAL, system_id, (float(message_id), float(interval_us)))


def answers_interval(ack: Mapping[str, Any]) -> bool:
    """Whether COMMAND_ACK answers what is asked for again and again: a message's interval."""
    return ack.get("command") == _SET_MESSAGE_INTERVAL


def _command(number: int, system_id: int, values: tuple[float, ...]) -> dict[str, Any]:
    padded = (*values, *(0.0,) * (7 - len(values)))
    return {
        "target_system": system_id,
        "target_component": 1,
        "command": number,
        "confirmation": 0,
        **{f"param{i}": value for i, value in enumerate(padded, start=1)},
    }


def _number(value: object) -> float:
    """Read a float field; MAVSDK writes null or a word where it is not finite."""
    return float(value) if isinstance(value, int | float) else math.nan
