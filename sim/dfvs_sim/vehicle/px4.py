"""A vehicle that behaves like PX4 v1.17 towards MAVLink, without I/O: time is passed in.

``handle`` takes one message and answers it; ``step`` advances the world in fixed steps up to now
and returns what is to be sent. Positions are in the local frame (NED), whose origin lies a little
above the spawn point, so that ``LOCAL_POSITION_NED.z`` is not zero on the ground.
"""

from collections.abc import Callable
from typing import Any

import numpy as np
from pymavlink.dialects.v20 import development as mavlink

from dfvs_sim.vehicle.commands import CommandHandler
from dfvs_sim.vehicle.failsafe import (
    Refusal,
    arming_refusal,
    flown_mode,
    mode_refusal,
    should_disarm,
)
from dfvs_sim.vehicle.messages.streams import RATES_HZ, LinkState, Schedule
from dfvs_sim.vehicle.messages.telemetry import Message, Telemetry
from dfvs_sim.vehicle.modes import Mode
from dfvs_sim.vehicle.motion.flight import Flight, VehicleConfig
from dfvs_sim.vehicle.motion.navigation import Sticks
from dfvs_sim.vehicle.motion.setpoints import BODY_NED, LOCAL_NED, Setpoint, demand_from_setpoint
from dfvs_sim.vehicle.parameters import ParameterTable
from dfvs_sim.vehicle.status import NS_PER_S, Status

STEP_NS = 4_000_000
_CHECK_NS = 100 * 1_000_000
_PUBLISH_NS = 500 * 1_000_000
_GCS_TIMEOUT_NS = 3 * NS_PER_S

Journal = Callable[[int, str, dict[str, Any]], None]
"""Where the vehicle's own record goes: (t_ns, kind, fields)."""


def no_journal(t_ns: int, kind: str, fields: dict[str, Any]) -> None:
    """Record nothing."""


class Px4:
    """The simulated vehicle with PX4's face."""

    def __init__(
        self,
        config: VehicleConfig,
        now_ns: int,
        rng: np.random.Generator,
        journal: Journal = no_journal,
    ) -> None:
        self.config = config
        self.journal = journal
        self.rng = rng
        self.parameters = ParameterTable({"MAV_SYS_ID": config.system_id, **config.parameters})
        self.status = Status(boot_ns=now_ns, home_m=(0.0, 0.0, config.ground_m))
        self.flight = Flight(config, self.parameters, self.status, rng)
        self.telemetry = Telemetry(self.status, self.flight)
        self.links = {name: LinkState(Schedule(RATES_HZ[name], now_ns)) for name in RATES_HZ}
        self._commands = CommandHandler(self)
        self._later: list[tuple[int, str, Message]] = []
        self.time_ns = now_ns
        """Monotonic time of the present state: the last whole step."""
        self._next_check_ns = now_ns
        self._handlers: dict[str, Callable[[Message, str, int], list[Message]]] = {
            "HEARTBEAT": self._on_heartbeat,
            "SET_POSITION_TARGET_LOCAL_NED": self._on_setpoint,
            "MANUAL_CONTROL": self._on_sticks,
            "SET_MODE": self._commands.on_set_mode,
            "COMMAND_LONG": self._commands.on_command,
            "COMMAND_INT": self._commands.on_command,
            "PARAM_REQUEST_READ": lambda m, link, now_ns: self.parameters.read(m),
            "PARAM_REQUEST_LIST": self._on_param_list,
            "PARAM_SET": self._on_param_set,
            "PING": self._on_ping,
            "TIMESYNC": self._on_timesync,
        }

    # What comes in

    def handle(self, message: Message, link: str, now_ns: int) -> list[Message]:
        """Take one message from a link; the answers go back on the same link."""
        handler = self._handlers.get(message.get_type())
        target = getattr(message, "target_system", 0) or getattr(message, "target", 0)
        if handler is None or self.links[link].dropped:
            return []
        if target not in (0, self.config.system_id):
            return []
        return handler(message, link, now_ns)

    def _on_heartbeat(self, message: Message, link: str, now_ns: int) -> list[Message]:
        if message.type == mavlink.MAV_TYPE_GCS:
            self.links[link].gcs_ns = now_ns
        self.record(now_ns, "heartbeat", message, link, type=message.type)
        return []

    def _on_setpoint(self, m: Message, link: str, now_ns: int) -> list[Message]:
        setpoint = Setpoint(
            m.coordinate_frame,
            m.type_mask,
            (m.x, m.y, m.z),
            (m.vx, m.vy, m.vz),
            (m.afx, m.afy, m.afz),
            m.yaw,
            m.yaw_rate,
        )
        known = setpoint.frame in (LOCAL_NED, BODY_NED)
        demand = demand_from_setpoint(setpoint, self.flight.estimate.yaw_rad) if known else None
        self.record(now_ns, "setpoint", m, link, **setpoint.as_json(), valid=demand is not None)
        if not known:
            self.send_text(f"SET_POSITION_TARGET_LOCAL_NED: frame {setpoint.frame} not supported")
        if demand is not None:
            self.status.setpoint_ns = now_ns
            if self.status.mode is Mode.OFFBOARD:
                self.flight.on_setpoint(demand)
        return []

    def _on_sticks(self, m: Message, link: str, now_ns: int) -> list[Message]:
        up = (m.z - 500) / 500.0
        sticks = Sticks(*(_stick(v) for v in (m.x / 1000.0, m.y / 1000.0, up, m.r / 1000.0)))
        self.status.manual_ns = now_ns
        self.flight.navigator.sticks = sticks
        return []

    def _on_param_list(self, m: Message, link: str, now_ns: int) -> list[Message]:
        for i, name in enumerate(self.parameters.names):
            self.send_later(now_ns + i * STEP_NS, link, self.parameters.value_message(name))
        return []

    def _on_param_set(self, m: Message, link: str, now_ns: int) -> list[Message]:
        answers = self.parameters.write(m)
        if answers:
            value = self.parameters[m.param_id]
            self.record(now_ns, "parameter", m, link, name=m.param_id, value=value)
            self.flight.update_gains()
        return answers

    def _on_ping(self, m: Message, link: str, now_ns: int) -> list[Message]:
        if m.target_system or m.target_component:
            return []
        source = m.get_srcSystem(), m.get_srcComponent()
        return [mavlink.MAVLink_ping_message(m.time_usec, m.seq, *source)]

    def _on_timesync(self, m: Message, link: str, now_ns: int) -> list[Message]:
        if m.tc1 != 0:
            return []
        return [mavlink.MAVLink_timesync_message(now_ns - self.status.boot_ns, m.ts1)]

    # What the autopilot's other parts request

    def record(self, now_ns: int, kind: str, message: Message, link: str, **fields: Any) -> None:
        """Put an event into the record, with the link and the sender of the message."""
        source = {"link": link, "sysid": message.get_srcSystem()}
        self.journal(now_ns, kind, {**source, "compid": message.get_srcComponent(), **fields})

    def send_text(self, text: str) -> None:
        """Queue a STATUSTEXT for the links on which a ground station is seen."""
        self.status.texts.append(text)

    def send_later(self, when_ns: int, link: str, message: Message) -> None:
        """Send on the link once the time has come."""
        self._later.append((when_ns, link, message))

    def request_mode(self, mode: Mode, now_ns: int) -> Refusal | None:
        """Change the intended mode; while disarmed that is always possible."""
        refusal = mode_refusal(mode, self.status, self.parameters, now_ns)
        if refusal is not None and self.status.armed:
            self.send_text(f"{mode.name} not possible: {refusal.value}")
            return refusal
        if self.status.mode is not Mode.TERMINATION or not self.status.armed:
            self.status.intended = mode
            if not mode.prevents_arming:
                self.status.after_disarming = mode
            self._supervise(now_ns)
        return None

    def arm(self, now_ns: int, *, force: bool = False) -> Refusal | None:
        """Arm, unless a check forbids it."""
        refusal = None if force else arming_refusal(self.status, self.parameters, now_ns)
        if refusal is not None:
            self.send_text(refusal.value)
            return refusal
        if not self.status.armed:
            self.status.armed, self.status.armed_ns, self.status.flew = True, now_ns, False
            self.status.home_m = self.flight.estimate.position_m
            self.flight.prepare()
            self._journal_state(now_ns, "armed")
        return None

    def disarm(self, now_ns: int, cause: str, *, force: bool = False) -> Refusal | None:
        """Disarm, in the air only by force; selects the last mode that can be armed."""
        if self.status.armed and not self.status.landed and not force:
            self.send_text(Refusal.IN_AIR.value)
            return Refusal.IN_AIR
        if self.status.armed:
            self.status.armed = self.status.failsafe = False
            self.status.intended = self.status.after_disarming
            self._journal_state(now_ns, f"disarmed: {cause}")
            self._supervise(now_ns)
        return None

    # What happens by itself

    def step(self, now_ns: int) -> list[tuple[str, Message]]:
        """Advance to now in steps of ``STEP_NS``; returns (link, message) to be sent."""
        while self.time_ns + STEP_NS <= now_ns:
            self.time_ns += STEP_NS
            if self.time_ns >= self._next_check_ns:
                self._next_check_ns = self.time_ns + _CHECK_NS
                self._supervise(self.time_ns)
            self._move()
        return self._outbox(now_ns)

    def _supervise(self, now_ns: int) -> None:
        """Readiness, failsafes, mode changes and disarming by itself."""
        s = self.status
        if now_ns - s.published_ns >= _PUBLISH_NS:
            s.published_ns = now_ns
        s.ready = now_ns - s.boot_ns >= self.config.ready_after_s * NS_PER_S
        s.estimator_ok = self.flight.estimate.valid
        s.can_arm = arming_refusal(s, self.parameters, now_ns) is None
        if s.armed and should_disarm(s, self.parameters, now_ns):
            self.disarm(now_ns, "on the ground")
        mode = flown_mode(s, self.parameters, now_ns)
        if mode is None:
            self.disarm(now_ns, "offboard setpoints lost", force=True)
            return
        failsafe = s.armed and mode is not s.intended
        if mode is not s.mode or failsafe is not s.failsafe:
            previous, s.mode, s.failsafe = s.mode, mode, failsafe
            s.published_ns = now_ns
            if failsafe:
                self.send_text(f"Failsafe activated: {mode.name.lower()}")
            self.flight.enter(mode, previous)
            self._journal_state(now_ns, "failsafe" if failsafe else "mode")

    def _move(self) -> None:
        """One step of motion, and what follows from where it leads."""
        s = self.status
        landed = self.flight.step(STEP_NS / NS_PER_S)
        if landed is not s.landed:
            s.landed = landed
            s.landed_ns = self.time_ns
            s.flew = s.flew or not landed
            self._journal_state(self.time_ns, "landed" if landed else "lifted off")
        if s.mode is Mode.TAKEOFF and self.flight.takeoff_is_over():
            self.request_mode(Mode.HOLD, self.time_ns)

    def _journal_state(self, now_ns: int, cause: str) -> None:
        s = self.status
        fields = {"mode": s.mode.name, "intended": s.intended.name, "armed": s.armed}
        more = {"landed": s.landed, "failsafe": s.failsafe, "cause": cause}
        self.journal(now_ns, "state", {**fields, **more})

    def _outbox(self, now_ns: int) -> list[tuple[str, Message]]:
        """Everything that is due: answers put off, streams, texts."""
        out: list[tuple[str, Message]] = []
        if self._later:
            out = [(link, message) for when, link, message in self._later if when <= now_ns]
            self._later = [entry for entry in self._later if entry[0] > now_ns]
        texts, self.status.texts = self.status.texts, []
        for name, link in self.links.items():
            if link.gcs_ns is not None and now_ns - link.gcs_ns < _GCS_TIMEOUT_NS:
                out.extend((name, _statustext(text)) for text in texts)
            for kind in link.due(now_ns, self.status.published_ns):
                message = self.telemetry.build(kind, self.time_ns)
                if message is not None:
                    out.append((name, message))
        return [(name, message) for name, message in out if not self.links[name].dropped]


def _statustext(text: str) -> Message:
    return mavlink.MAVLink_statustext_message(mavlink.MAV_SEVERITY_WARNING, text.encode()[:50])


def _stick(value: float) -> float:
    return min(1.0, max(-1.0, value))
