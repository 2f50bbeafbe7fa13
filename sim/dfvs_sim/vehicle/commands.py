"""COMMAND_LONG and COMMAND_INT: what PX4 does with each and how it acknowledges."""

import math
from collections.abc import Callable
from typing import Any, Protocol

import numpy as np
from pymavlink.dialects.v20 import development as mavlink

from dfvs_sim.vehicle.failsafe import Refusal
from dfvs_sim.vehicle.messages.earth import HOME_ALTITUDE_M
from dfvs_sim.vehicle.messages.streams import COMPANION, GROUND, LinkState
from dfvs_sim.vehicle.messages.telemetry import Message, Telemetry
from dfvs_sim.vehicle.modes import Mode, mode_from_custom, mode_from_numbers
from dfvs_sim.vehicle.motion.flight import Flight
from dfvs_sim.vehicle.parameters import ParameterTable
from dfvs_sim.vehicle.status import Status

ACCEPTED, REJECTED, DENIED, UNSUPPORTED, FAILED = 0, 1, 2, 3, 4
"""MAV_RESULT; REJECTED is TEMPORARILY_REJECTED."""

_FORCE = 21196
_SECOND_ACK_NS = 8_000_000
_CUSTOM_MODE = 1

_FAULT_OK, _FAULT_OFF, _FAULT_WRONG = 0, 1, 4
"""FAILURE_TYPE."""
_EMPTY_BATTERY = 0.04
_WRONG_FIX_M = 2.0
_SILENCED = {0: (COMPANION, GROUND), 1: (COMPANION,), 2: (GROUND,)}
"""Links that a fault of the MAVLink signal silences, by its instance."""

_KINDS = {
    mavlink.MAV_CMD_COMPONENT_ARM_DISARM: "arm_command",
    mavlink.MAV_CMD_DO_SET_MODE: "mode_command",
    mavlink.MAV_CMD_NAV_LAND: "mode_command",
    mavlink.MAV_CMD_NAV_TAKEOFF: "mode_command",
    mavlink.MAV_CMD_NAV_RETURN_TO_LAUNCH: "mode_command",
}
"""How a command is called in the vehicle's record."""

Params = tuple[float, ...]


class Autopilot(Protocol):
    """What commands act on."""

    status: Status
    parameters: ParameterTable
    flight: Flight
    telemetry: Telemetry
    links: dict[str, LinkState]
    rng: np.random.Generator

    def request_mode(self, mode: Mode, now_ns: int) -> Refusal | None:
        """Change the intended mode."""

    def arm(self, now_ns: int, *, force: bool = False) -> Refusal | None:
        """Arm."""

    def disarm(self, now_ns: int, cause: str, *, force: bool = False) -> Refusal | None:
        """Disarm."""

    def record(self, now_ns: int, kind: str, message: Message, link: str, **fields: Any) -> None:
        """Put an event into the record."""

    def send_later(self, when_ns: int, link: str, message: Message) -> None:
        """Send once the time has come."""


class CommandHandler:
    """Acts on commands and gives their acks."""

    def __init__(self, px4: Autopilot) -> None:
        self._px4 = px4
        self._results: dict[int, Callable[[Params, str, int], int]] = {
            mavlink.MAV_CMD_NAV_RETURN_TO_LAUNCH: self._to_mode(Mode.RETURN),
            mavlink.MAV_CMD_NAV_LAND: self._to_mode(Mode.LAND),
            mavlink.MAV_CMD_NAV_TAKEOFF: self._take_off,
            mavlink.MAV_CMD_COMPONENT_ARM_DISARM: self._arm,
            mavlink.MAV_CMD_SET_MESSAGE_INTERVAL: self._set_interval,
            mavlink.MAV_CMD_GET_MESSAGE_INTERVAL: self._get_interval,
            mavlink.MAV_CMD_REQUEST_MESSAGE: self._request_message,
            mavlink.MAV_CMD_REQUEST_AUTOPILOT_CAPABILITIES: self._sends("AUTOPILOT_VERSION"),
            mavlink.MAV_CMD_GET_HOME_POSITION: self._sends("HOME_POSITION"),
            mavlink.MAV_CMD_INJECT_FAILURE: self._inject_failure,
        }

    def on_command(self, message: Message, link: str, now_ns: int) -> list[Message]:
        """Act on one command; returns the ack that goes out at once."""
        if message.target_component not in (0, 1):
            return []
        params, command = _params(message), message.command
        mode: Mode | None = None
        if command == mavlink.MAV_CMD_DO_SET_MODE:
            mode = _wanted_mode(params)
            result = self._set_mode(mode, now_ns)
        else:
            act = self._results.get(command)
            result = act(params, link, now_ns) if act else UNSUPPORTED
        fields = {
            "command": command,
            "params": [p if math.isfinite(p) else str(p) for p in params],
            "mode": mode.name if mode else None,
            "result": result,
        }
        self._px4.record(now_ns, _KINDS.get(command, "command"), message, link, **fields)
        if command != mavlink.MAV_CMD_DO_SET_MODE:
            return [_ack(message, command, result)]
        delay_ns = int(self._px4.rng.integers(0, _SECOND_ACK_NS, endpoint=True))
        self._px4.send_later(now_ns + delay_ns, link, _ack(message, command, result))
        return [_ack(message, command, ACCEPTED)]

    def on_set_mode(self, message: Message, link: str, now_ns: int) -> list[Message]:
        """SET_MODE, the old message without an ack."""
        is_custom = message.base_mode & _CUSTOM_MODE
        mode = mode_from_custom(message.custom_mode) if is_custom else None
        result = self._set_mode(mode, now_ns)
        name = mode.name if mode else None
        self._px4.record(
            now_ns, "mode_command", message, link, command=11, mode=name, result=result
        )
        return []

    def _set_mode(self, mode: Mode | None, now_ns: int) -> int:
        if mode is None:
            return REJECTED
        return ACCEPTED if self._px4.request_mode(mode, now_ns) is None else REJECTED

    def _to_mode(self, mode: Mode) -> Callable[[Params, str, int], int]:
        return lambda params, link, now_ns: self._set_mode(mode, now_ns)

    def _take_off(self, params: Params, link: str, now_ns: int) -> int:
        """Take off to the altitude above sea level in param7, or to MIS_TAKEOFF_ALT."""
        altitude_m = params[6]
        down_m = HOME_ALTITUDE_M - altitude_m if math.isfinite(altitude_m) else None
        self._px4.flight.navigator.takeoff_down_m = down_m
        return self._set_mode(Mode.TAKEOFF, now_ns)

    def _arm(self, params: Params, link: str, now_ns: int) -> int:
        force = params[1] == _FORCE
        if params[0] == 1.0:
            refusal = self._px4.arm(now_ns, force=force)
        elif params[0] == 0.0:
            refusal = self._px4.disarm(now_ns, "command", force=force)
        else:
            return DENIED
        return ACCEPTED if refusal is None else REJECTED

    def _set_interval(self, params: Params, link: str, now_ns: int) -> int:
        name = _message_name(params[0])
        if name not in self._px4.telemetry.builders or not math.isfinite(params[1]):
            return FAILED
        self._px4.links[link].schedule.set_interval(name, params[1], now_ns)
        return ACCEPTED

    def _get_interval(self, params: Params, link: str, now_ns: int) -> int:
        name = _message_name(params[0])
        if name not in self._px4.telemetry.builders:
            return FAILED
        interval_us = self._px4.links[link].schedule.interval_us(name)
        answer = mavlink.MAVLink_message_interval_message(int(params[0]), interval_us)
        self._px4.send_later(now_ns, link, answer)
        return ACCEPTED

    def _request_message(self, params: Params, link: str, now_ns: int) -> int:
        return self._send_once(_message_name(params[0]), link, now_ns)

    def _sends(self, name: str) -> Callable[[Params, str, int], int]:
        return lambda params, link, now_ns: self._send_once(name, link, now_ns)

    def _inject_failure(self, params: Params, link: str, now_ns: int) -> int:
        """Faults on demand, as PX4's simulation offers them; SYS_FAILURE_EN must be 1.

        Four of PX4's units are known. OFF empties the battery. GPS OFF ends the position
        estimate, and WRONG shifts it to the north. An accelerometer that is WRONG makes the arming
        check warn of the estimate. OFF of the MAVLink signal silences links in both directions.
        OK repairs each, but takes back no shift.
        """
        px4 = self._px4
        if px4.parameters["SYS_FAILURE_EN"] != 1:
            return DENIED
        if not all(math.isfinite(p) for p in params[:3]):
            return UNSUPPORTED
        unit, kind, instance = (int(p) for p in params[:3])
        is_switch = kind in (_FAULT_OK, _FAULT_OFF)
        if unit == mavlink.FAILURE_UNIT_SYSTEM_BATTERY and is_switch:
            px4.status.battery = _EMPTY_BATTERY if kind == _FAULT_OFF else 1.0
        elif unit == mavlink.FAILURE_UNIT_SENSOR_GPS and is_switch:
            px4.flight.estimate.valid = kind == _FAULT_OK
        elif unit == mavlink.FAILURE_UNIT_SENSOR_GPS and kind == _FAULT_WRONG:
            px4.flight.estimator.reset_position(_WRONG_FIX_M, 0.0, 0.0)
        elif unit == mavlink.FAILURE_UNIT_SENSOR_ACCEL and kind in (_FAULT_OK, _FAULT_WRONG):
            px4.status.warns_of_estimate = kind == _FAULT_WRONG
        elif unit == mavlink.FAILURE_UNIT_SYSTEM_MAVLINK_SIGNAL and is_switch:
            if instance not in _SILENCED:
                return UNSUPPORTED
            for name in _SILENCED[instance]:
                px4.links[name].dropped = kind == _FAULT_OFF
        else:
            return UNSUPPORTED
        return ACCEPTED

    def _send_once(self, name: str, link: str, now_ns: int) -> int:
        if name not in self._px4.telemetry.builders:
            return DENIED
        message = self._px4.telemetry.build(name, now_ns)
        if message is None:
            return DENIED
        self._px4.send_later(now_ns, link, message)
        return ACCEPTED


def _params(message: Message) -> Params:
    """The seven parameters; COMMAND_INT carries two of them under other names."""
    if message.get_type() == "COMMAND_INT":
        places = (float(message.x), float(message.y), message.z)
        return (message.param1, message.param2, message.param3, message.param4, *places)
    return tuple(getattr(message, f"param{i}") for i in range(1, 8))


def _wanted_mode(params: Params) -> Mode | None:
    """Mode in DO_SET_MODE; None for base modes and for numbers that mean nothing here."""
    if not all(math.isfinite(p) for p in params[:3]) or not int(params[0]) & _CUSTOM_MODE:
        return None
    return mode_from_numbers(int(params[1]), int(params[2]))


def _message_name(number: float) -> str:
    """Name of a MAVLink message; empty where there is no such number."""
    known = mavlink.mavlink_map.get(int(number)) if math.isfinite(number) else None
    return str(known.msgname) if known else ""


def _ack(message: Message, command: int, result: int) -> Message:
    source = message.get_srcSystem(), message.get_srcComponent()
    return mavlink.MAVLink_command_ack_message(command, result, 0, 0, *source)
