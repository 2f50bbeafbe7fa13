"""State of one engagement, from ENGAGE until the vehicle is handed back."""

import math
from dataclasses import dataclass

from dfvs_core.gate.checks.initial_response import InitialResponse
from dfvs_core.gate.config import Engage, GateConfig
from dfvs_core.gate.events import Heartbeat, VehicleMode
from dfvs_core.gate.states import Cause
from dfvs_core.gate.vehicle import Fault, VehicleMonitor

_COMMANDED_FROM = frozenset({VehicleMode.HOLD, VehicleMode.POSITION})


@dataclass(slots=True)
class Engagement:
    """State of the engagement."""

    start_ns: int
    start_m: tuple[float, float, float]
    mode_before: VehicleMode
    is_confirmed: bool
    requested_ns: int | None = None
    is_held: bool = False
    """The operator commanded to hold."""
    reached_ns: int | None = None
    """When the goal was reached, where it is held by vision since."""
    hold_requested: bool = False
    """The autopilot's Hold was asked for because the goal is reached."""
    handed_over: bool = False
    """The autopilot confirmed that Hold."""
    is_confirmed_response: bool = False
    """The initial-response check has passed."""
    response: InitialResponse | None = None

    def on_heartbeat(self, heartbeat: Heartbeat) -> Fault | None:
        """Take a heartbeat; return why it ends the engagement, None where it does not."""
        mode = heartbeat.mode
        if self.handed_over:
            return None
        if not heartbeat.armed:
            return Cause.DISARMED, ""
        if mode is VehicleMode.OFFBOARD:
            self.is_confirmed = True
            return None
        if self.hold_requested and mode is VehicleMode.HOLD:
            self.handed_over = True
            return None
        if self.is_confirmed or mode is not self.mode_before:
            return Cause.TAKEOVER, f"to {mode}"
        return None


def begin(vehicle: VehicleMonitor, now_ns: int) -> Engagement:
    """Return an engagement that starts here and now."""
    mode = vehicle.heartbeat.mode
    is_confirmed = mode is VehicleMode.OFFBOARD
    return Engagement(now_ns, vehicle.position.position_m, mode, is_confirmed)


def offer(vehicle: VehicleMonitor, config: GateConfig, is_commanded: bool) -> Cause | None:
    """Say why the gate may leave READY for ENGAGE now, None where it may not."""
    if config.engage is Engage.NEVER or not vehicle.is_flying:
        return None
    mode = vehicle.heartbeat.mode
    if config.engage is Engage.PILOT:
        return Cause.PILOT_ENGAGED if mode is VehicleMode.OFFBOARD else None
    if config.engage is Engage.AUTO:
        return Cause.AUTO_ENGAGED if mode is VehicleMode.HOLD else None
    return Cause.COMMAND_ENGAGED if is_commanded and mode in _COMMANDED_FROM else None


def cap(
    engagement: Engagement, vehicle: VehicleMonitor, config: GateConfig, now_ns: int
) -> Fault | None:
    """Name the bound of distance or time that the engagement has crossed."""
    distance = math.dist(vehicle.position.position_m, engagement.start_m)
    if not distance <= config.max_distance_m:
        return Cause.DISTANCE_CAP, f"{distance:.2f} m, {config.max_distance_m:g} m allowed"
    if engagement.reached_ns is not None:
        since_ns, allowed_ns = engagement.reached_ns, config.hold_visual_ns
    else:
        since_ns, allowed_ns = engagement.start_ns, config.max_engaged_ns
    if now_ns - since_ns > allowed_ns:
        return Cause.TIME_CAP, f"{allowed_ns / 1e9:g} s allowed"
    return None
