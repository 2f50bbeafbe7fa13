"""Detection of other commanders of the vehicle (invariant I6).

There are three signs: another service's lease on the vehicle's name, a foreign setpoint on the same
MAVLink link, and an unexplained velocity. The latter is one that the autopilot reports and that was
never sent here. The first second of a pilot's takeover looks the same. A request for Hold would
then take the vehicle from the pilot. So the sign counts only once a later heartbeat still shows
OFFBOARD.
"""

import math
from collections import deque
from dataclasses import dataclass, field

from dfvs_core.gate.config import MS, NEVER, S
from dfvs_core.gate.events import (
    AmbiguousLink,
    ForeignSetpoint,
    Heartbeat,
    MonitorFailed,
    OtherServices,
    VelocityTarget,
)
from dfvs_core.gate.limits import BodyVelocity
from dfvs_core.gate.states import Cause

SEEN_NS = 5 * S
"""A foreign setpoint forbids to engage for so long."""

MAX_UNEXPLAINED_M_S = 0.2
"""Difference from every velocity that was sent lately; yaw changes and delays explain less."""

UNEXPLAINED_TARGETS = 3
_UNEXPLAINED_LAPSE_NS = 1 * S
_SENT_NS = 500 * MS

OtherCommanderEvent = (
    OtherServices | ForeignSetpoint | AmbiguousLink | VelocityTarget | MonitorFailed
)


@dataclass(slots=True)
class OtherCommanders:
    """Last received signs of other commanders."""

    services: OtherServices = field(default_factory=lambda: OtherServices(NEVER))
    setpoint: ForeignSetpoint = field(default_factory=lambda: ForeignSetpoint(NEVER, ""))
    ambiguous_link: str = ""
    """Which autopilots are on the link, where there are several and the settings name none."""
    monitor_failure: str = ""
    """Why parameters and other commanders are not watched any more, empty where they are."""
    _sent: deque[tuple[int, BodyVelocity]] = field(default_factory=deque)
    _first_unexplained_ns: int | None = None
    _last_unexplained_ns: int = NEVER
    _confirmed: bool = False
    """A heartbeat later than the first odd target showed OFFBOARD."""
    _unexplained_count: int = 0
    """Odd targets since then."""
    _detail: str = ""

    def sent(self, setpoint: BodyVelocity, now_ns: int) -> None:
        """Remember a setpoint that was sent."""
        self._sent.append((now_ns, setpoint))
        while len(self._sent) > 1 and self._sent[1][0] < now_ns - _SENT_NS:
            self._sent.popleft()

    def forget_targets(self) -> None:
        """Judge the autopilot's targets anew: another engagement begins."""
        self._sent.clear()
        self._lapse()

    def on_heartbeat(self, heartbeat: Heartbeat, *, is_offboard: bool) -> None:
        """Update by a heartbeat: an unexplained target may have been a change of the mode."""
        if not is_offboard:
            self._lapse()
        elif self._first_unexplained_ns is not None and heartbeat.t_ns > self._first_unexplained_ns:
            self._confirmed = True

    def update(self, event: OtherCommanderEvent, yaw_rad: float) -> None:
        """Remember an event; ``yaw_rad`` is the vehicle's heading."""
        match event:
            case OtherServices():
                self.services = event
            case ForeignSetpoint():
                self.setpoint = event
            case AmbiguousLink():
                self.ambiguous_link = event.detail
            case MonitorFailed():
                self.monitor_failure = event.detail
            case _:
                self._compare(event, yaw_rad)

    def _compare(self, target: VelocityTarget, yaw_rad: float) -> None:
        """Compare the velocity that the autopilot flies with those that were sent lately."""
        if not self._sent or not all(math.isfinite(v) for v in (*target.velocity_m_s, yaw_rad)):
            return
        miss = min(_miss(target, v, yaw_rad) for _, v in self._sent)
        if miss <= MAX_UNEXPLAINED_M_S:
            if target.t_ns - self._last_unexplained_ns > _UNEXPLAINED_LAPSE_NS:
                self._lapse()
            return
        self._last_unexplained_ns = target.t_ns
        if self._first_unexplained_ns is None:
            self._first_unexplained_ns = target.t_ns
        self._unexplained_count += self._confirmed
        self._detail = f"the autopilot flies a velocity that is {miss:.2f} m/s from any of ours"

    def preflight_fault(self, now_ns: int) -> str:
        """Say why nobody may engage now, empty where somebody may."""
        if names := self.services.standing_by + self.services.engaged:
            return f"another service for this vehicle runs ({', '.join(names)}): stop one of them"
        if now_ns - self.setpoint.t_ns <= SEEN_NS:
            return f"somebody else sends setpoints ({self.setpoint.detail})"
        return ""

    def flight_fault(self, engaged_ns: int) -> tuple[Cause, str] | None:
        """Name another commander that was seen since the engagement began."""
        if self.services.engaged:
            names = ", ".join(self.services.engaged)
            return Cause.TWO_COMMANDERS, f"another service is engaged ({names})"
        if self.setpoint.t_ns >= engaged_ns:
            return Cause.TWO_COMMANDERS, f"setpoints of somebody else ({self.setpoint.detail})"
        if self._unexplained_count >= UNEXPLAINED_TARGETS:
            return Cause.TWO_COMMANDERS, self._detail
        return None

    def _lapse(self) -> None:
        self._first_unexplained_ns, self._confirmed, self._unexplained_count = None, False, 0


def _miss(target: VelocityTarget, sent: BodyVelocity, yaw_rad: float) -> float:
    """Length of the difference between a target (NED) and a setpoint (body), m/s."""
    c, s = math.cos(yaw_rad), math.sin(yaw_rad)
    north = c * sent.forward_m_s - s * sent.right_m_s
    east = s * sent.forward_m_s + c * sent.right_m_s
    return math.dist(target.velocity_m_s, (north, east, sent.down_m_s))
