"""Adapter of the autopilot through MAVSDK 4.

Setpoints and mode requests leave as single messages through ``MavlinkDirect``. The ``Offboard``
plugin is not used: a native thread of it would go on sending the last velocity at 20 Hz while
Python hangs. This way a hung gate is silent at once.

Callbacks come on MAVSDK's threads and only hand events on. Setting up blocks, and so belongs on
a helper thread; sending takes a fraction of a millisecond.
"""

import functools
import json
import time
from collections.abc import Callable, Mapping
from typing import Any

from mavsdk import LogLevel, Mavsdk, MavsdkError, log_subscribe
from mavsdk.plugins.mavlink_direct.mavlink_direct import MavlinkDirect, MavlinkMessage
from mavsdk.plugins.param.param import Param

from dfvs_common.status_text import plain_text, system_names
from dfvs_core.errors import DfvsError
from dfvs_core.gate.events import AmbiguousLink, ModeRequest, VehicleEvent
from dfvs_core.gate.limits import BodyVelocity, VelocityLimits
from dfvs_service.gate import px4
from dfvs_service.gate.failsafe import LOSS_ACTION, LOSS_TIME, judge_failsafe
from dfvs_service.gate.mavlink_systems import connect_autopilot, is_autopilot
from dfvs_service.gate.serial_device import SerialDevice, SerialDeviceError, wait_for_device
from dfvs_service.gate.speed_limits import SPEED_LIMITS, speed_refusals
from dfvs_service.ports import require_free_mavlink_port
from dfvs_service.settings.mavlink_url import MavlinkUrl

AUTOPILOT_COMPONENT = 1
_POLL_S = 0.5
_READ_AGAIN_S = 1.0
_READ_EVERY_S = 10.0
LISTEN_S = 1.5
"""Every autopilot on a link sends a heartbeat within this time."""

Emit = Callable[[VehicleEvent], None]
Note = Callable[[str, str], None]
_Convert = Callable[[int, Mapping[str, Any]], VehicleEvent | None]


class Autopilot:
    """Connection to one autopilot.

    ``emit`` takes the vehicle's events and ``note`` (kind, text) for the log, from any thread,
    without blocking. ``allow_return``: advise against a return to launch where setpoints stop, and
    do not refuse it. ``limits`` of the setpoints must not be above the autopilot's. ``system_id``
    is the autopilot's MAVLink system id; 0 takes the only one on the link.
    """

    def __init__(
        self,
        emit: Emit,
        note: Note,
        *,
        allow_return: bool = False,
        limits: VelocityLimits | None = None,
        system_id: int = 0,
    ) -> None:
        self._emit = emit
        self._note = note
        self._allow_return = allow_return
        self._limits = limits or VelocityLimits()
        self._mavsdk: Mavsdk | None = None
        self._direct: MavlinkDirect | None = None
        self._param: Param | None = None
        self._serial: SerialDevice | None = None
        self._has_read_failsafe = False
        self._is_named = system_id != 0
        self._system_id = system_id
        self._others: dict[int, MavlinkDirect] = {}
        """Other systems on this link, by their id: each has a subscription of its own."""
        self._other_autopilots: set[int] = set()
        self._expected: set[Any] = {0}
        """Results of requests for an interval that need not be noted any more."""
        log_subscribe(self._on_log)

    def _on_log(self, level: LogLevel, message: str, _file: str | None, _line: int) -> bool:
        if level >= LogLevel.WARN:
            self._note("mavsdk", plain_text(message))
        return True

    def connect(self, url: str, timeout_s: float) -> None:
        """Open the connection and wait for an autopilot; blocks.

        Raises
        ------
        ConfigError
            If another program has the port.
        SerialDeviceError
            If a serial device is not there in time, may not be used, or another program has it.
        VehicleError
            If the connection cannot be opened or no autopilot is received in time.
        """
        require_free_mavlink_port(url)
        path = MavlinkUrl.parse(url).device
        self._serial = None if path is None else wait_for_device(path, timeout_s)
        self._mavsdk, system = connect_autopilot(url, self._system_id, timeout_s)
        self._system_id = int(system.get_system_id())
        self._note("autopilot", f"{system_names({self._system_id})} on {url}")
        direct = MavlinkDirect(system)
        self._subscribe(direct)
        self._param = Param(system)
        self._direct = direct

    def _subscribe(self, direct: MavlinkDirect) -> None:
        """Subscribe to every message that the gate judges by."""
        single: dict[str, _Convert] = {
            "HEARTBEAT": px4.heartbeat,
            "CURRENT_MODE": px4.current_mode,
            "ATTITUDE_QUATERNION": px4.attitude,
            "LOCAL_POSITION_NED": px4.local_position,
            "EXTENDED_SYS_STATE": px4.landed_state,
            "ESTIMATOR_STATUS": px4.estimator_status,
            "POSITION_TARGET_LOCAL_NED": px4.velocity_target,
        }
        for name, convert in single.items():
            self._listen(direct, name, functools.partial(self._on_single, convert))
        self._listen(direct, "SYS_STATUS", self._on_system_status)
        self._listen(direct, "COMMAND_ACK", self._on_ack)
        self._subscribe_foreign(direct)

    def _subscribe_foreign(self, direct: MavlinkDirect) -> None:
        for name in px4.FOREIGN_SETPOINTS:
            direct.subscribe_message(name, self._on_foreign)

    def _listen(
        self, direct: MavlinkDirect, name: str, take: Callable[[int, Mapping[str, Any]], None]
    ) -> None:
        def on_message(message: MavlinkMessage, _user_data: object) -> None:
            t_ns = time.monotonic_ns()
            if message.component_id == AUTOPILOT_COMPONENT:
                take(t_ns, json.loads(message.fields_json))

        direct.subscribe_message(name, on_message)

    def _on_single(self, convert: _Convert, t_ns: int, fields: Mapping[str, Any]) -> None:
        event = convert(t_ns, fields)
        if event is not None:
            self._emit(event)

    def _on_foreign(self, message: MavlinkMessage, _user_data: object) -> None:
        """Take a commander's message from whoever sent it: what we send does not come back."""
        sender = (int(message.system_id), int(message.component_id))
        fields = json.loads(message.fields_json)
        event = px4.foreign_setpoint(
            time.monotonic_ns(), message.message_name, sender, fields, self._system_id
        )
        if event is not None:
            self._emit(event)

    def _on_system_status(self, t_ns: int, fields: Mapping[str, Any]) -> None:
        for event in px4.system_status(t_ns, fields):
            self._emit(event)

    def _on_ack(self, _t_ns: int, fields: Mapping[str, Any]) -> None:
        # Only for the log: PX4 acknowledges a mode change twice, and the first one always says
        # yes. What happened is seen in the mode. An interval is refused by an autopilot that does
        # not know the message, such as CURRENT_MODE before PX4 1.15: that is logged once.
        result = fields.get("result")
        if px4.answers_interval(fields):
            if result in self._expected:
                return
            self._expected.add(result)
        self._note("ack", f"command {fields.get('command')} result {result}")

    def watch(self, on_device_lost: Callable[[DfvsError], None]) -> None:
        """Keep telemetry coming, parameters read and other systems monitored.

        All of it again and again: a request may be lost, an autopilot starts anew with other
        parameters, and a system that sends setpoints need not have been there before. Returns
        only after the loss of a serial device, which MAVSDK never opens again.

        ``on_device_lost`` takes the error that says so, and must not block.
        """
        self._request_telemetry()
        next_read_s = time.monotonic()
        if not self._is_named:
            next_read_s += LISTEN_S  # so that no flight begins before all autopilots were heard
        while True:
            if self._serial is not None and self._serial.is_lost():
                on_device_lost(_lost(self._serial))
                return
            self.receive_from_others()
            if time.monotonic() >= next_read_s:
                self._request_telemetry()
                known = self._read_parameters()
                next_read_s = time.monotonic() + (_READ_EVERY_S if known else _READ_AGAIN_S)
            time.sleep(_POLL_S)

    def receive_from_others(self) -> None:
        """Subscribe to what other systems send, and report other autopilots.

        MAVSDK gives a system's own messages alone.
        """
        for system in [] if self._mavsdk is None else self._mavsdk.get_systems():
            number = int(system.get_system_id())
            if number in (0, self._system_id):
                continue
            if number not in self._others:
                self._others[number] = MavlinkDirect(system)
                self._subscribe_foreign(self._others[number])
            if number not in self._other_autopilots and is_autopilot(system):
                self._other_autopilots.add(number)
                self._report_ambiguity()

    def _report_ambiguity(self) -> None:
        """Report several autopilots, unless the settings name one of them."""
        if self._is_named:
            return
        names = system_names({self._system_id, *self._other_autopilots})
        detail = f"autopilots of {names} on one link, {self._system_id} was heard first"
        self._emit(AmbiguousLink(time.monotonic_ns(), detail))

    def _request_telemetry(self) -> None:
        for message_id, interval_us in px4.MESSAGE_INTERVALS_US.items():
            fields = px4.interval_fields(message_id, interval_us, self._system_id)
            self._send("COMMAND_LONG", fields)

    def _read_parameters(self) -> bool:
        """Read failsafe and speed limits back; returns whether the autopilot sent the failsafe.

        Once it is known, a reading without an answer is none: the gate judges by its age. A speed
        limit without an answer, though the failsafe was sent, is one that this PX4 does not have.
        """
        if self._param is None:
            return False
        loss_s = _read(LOSS_TIME, self._param.get_param_float)
        action = _read(LOSS_ACTION, self._param.get_param_int)
        is_known = loss_s is not None and action is not None
        if is_known or not self._has_read_failsafe:
            names = SPEED_LIMITS if is_known else ()
            speeds = {name: _read(name, self._param.get_param_float) for name in names}
            read = judge_failsafe(
                time.monotonic_ns(),
                loss_s,
                action,
                allow_return=self._allow_return,
                others=speed_refusals(speeds, self._limits),
            )
            self._emit(read)
        self._has_read_failsafe |= is_known
        return is_known

    def send_velocity(self, velocity: BodyVelocity) -> None:
        """Send one setpoint."""
        # PX4 does not use the time; the field wraps like the vehicle's own uptime would.
        time_boot_ms = time.monotonic_ns() // 1_000_000 & 0xFFFFFFFF
        fields = px4.velocity_fields(velocity, self._system_id, time_boot_ms)
        self._send("SET_POSITION_TARGET_LOCAL_NED", fields)

    def request_mode(self, request: ModeRequest) -> None:
        """Ask for a mode, once, without waiting for an answer."""
        self._send("COMMAND_LONG", px4.mode_fields(request, self._system_id))

    def _send(self, name: str, fields: Mapping[str, Any]) -> None:
        if self._direct is None:
            return
        text = json.dumps(fields, allow_nan=False)
        message = MavlinkMessage(name, 0, 0, self._system_id, AUTOPILOT_COMPONENT, text)
        try:
            self._direct.send_message(message)
        except MavsdkError as error:
            # A setpoint that did not leave must not end the loop that would send the next one.
            self._note("send_failed", f"{name}: {error}")


def _lost(device: SerialDevice) -> SerialDeviceError:
    return SerialDeviceError(
        f"the serial device {device.path} was lost",
        "one that stays connected",
        "check cable and power, then start the service anew",
    )


def _read(name: str, get: Callable[[str], float]) -> float | None:
    """Value of a parameter, None where the autopilot does not send it."""
    try:
        return get(name)
    except MavsdkError:
        return None
