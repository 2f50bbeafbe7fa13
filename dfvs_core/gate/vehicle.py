"""Last received messages of the vehicle, and the faults they show."""

import math
from dataclasses import dataclass, field, replace

from dfvs_core.gate.config import NEVER, GateConfig, GateTiming, S
from dfvs_core.gate.events import (
    Attitude,
    Battery,
    CurrentMode,
    EstimatorState,
    Health,
    Heartbeat,
    LandedState,
    LocalPosition,
    ParametersRead,
    VehicleEvent,
    VehicleMode,
)
from dfvs_core.gate.other_commanders import OtherCommanders
from dfvs_core.gate.states import Cause

Fault = tuple[Cause, str]

_NOT_RECEIVED = "none heard yet"


@dataclass(slots=True)
class VehicleMonitor:
    """The newest message of each kind; before the first one, one that is infinitely old.

    ``heartbeat`` has the mode of CURRENT_MODE where that is newer; its age is its own.
    """

    timing: GateTiming = field(default_factory=GateTiming)
    heartbeat: Heartbeat = field(
        default_factory=lambda: Heartbeat(NEVER, VehicleMode.OTHER, armed=False)
    )
    attitude: Attitude = field(default_factory=lambda: Attitude(NEVER, 0.0, 0.0, 0.0))
    position: LocalPosition = field(
        default_factory=lambda: LocalPosition(NEVER, (0.0, 0.0, 0.0), (0.0, 0.0, 0.0))
    )
    landed: LandedState = field(
        default_factory=lambda: LandedState(NEVER, in_air=False, on_ground=False)
    )
    battery: Battery = field(default_factory=lambda: Battery(NEVER, None))
    health: Health = field(default_factory=lambda: Health(NEVER, ok=False, detail=_NOT_RECEIVED))
    estimator: EstimatorState = field(
        default_factory=lambda: EstimatorState(NEVER, valid=False, detail=_NOT_RECEIVED)
    )
    parameters: ParametersRead = field(default_factory=lambda: ParametersRead(NEVER))
    other_commanders: OtherCommanders = field(default_factory=OtherCommanders)
    unhealthy_since_ns: int = NEVER
    """Time of the first message on end that says that something is not healthy."""
    jump_m: float = 0.0
    """Largest step of the position estimate that its velocity does not explain."""
    mode_ns: int = NEVER
    """Time of the last message that reports the mode: HEARTBEAT or CURRENT_MODE."""
    link_returned_ns: int = NEVER
    """Time of the last attitude or position that ended a silence of the link."""

    def update(self, event: VehicleEvent) -> None:
        """Remember an event."""
        match event:
            case Heartbeat():
                self.heartbeat, self.mode_ns = event, event.t_ns
                self.other_commanders.on_heartbeat(event, is_offboard=self.is_offboard)
            case CurrentMode():
                self.heartbeat = replace(self.heartbeat, mode=event.mode)
                self.mode_ns = event.t_ns
            case Attitude():
                self._on_telemetry(event.t_ns)
                self.attitude = event
            case LocalPosition():
                self._on_position(event)
            case LandedState():
                self.landed = event
            case Battery():
                self.battery = event
            case Health():
                self._on_health(event)
            case EstimatorState():
                self.estimator = event
            case ParametersRead():
                self.parameters = event
            case _:
                self.other_commanders.update(event, self.attitude.yaw_rad)

    def _on_health(self, new: Health) -> None:
        self.health = new
        if new.ok:
            self.unhealthy_since_ns = NEVER
        elif self.unhealthy_since_ns == NEVER:
            self.unhealthy_since_ns = new.t_ns

    def _on_telemetry(self, t_ns: int) -> None:
        if t_ns - self._telemetry_ns > self.timing.link_silent_ns:
            self.link_returned_ns = t_ns

    def _on_position(self, new: LocalPosition) -> None:
        self._on_telemetry(new.t_ns)
        old = self.position
        self.position = new
        if old.t_ns == NEVER:
            return
        dt_s = max(new.t_ns - old.t_ns, 0) / S
        speed = max(math.hypot(*old.velocity_m_s), math.hypot(*new.velocity_m_s))
        jump = math.dist(old.position_m, new.position_m) - speed * dt_s
        self.jump_m = max(self.jump_m, jump) if math.isfinite(jump) else math.inf

    @property
    def _telemetry_ns(self) -> int:
        """Time of the last attitude or position, whichever came later."""
        return max(self.attitude.t_ns, self.position.t_ns)

    def is_mode_known(self, now_ns: int) -> bool:
        """Whether a change of mode would have been received by now.

        A change that fell into a silence of the link is known only by a later message of the mode.
        What a companion that stood still finds in its socket is older than the silence's end: a
        message of the mode counts only once the link has been back for ``link_silent_ns``.
        """
        silent_ns = self.timing.link_silent_ns
        is_linked = now_ns - self._telemetry_ns <= silent_ns
        is_after_silence = self.mode_ns - self.link_returned_ns > silent_ns
        is_recent = now_ns - self.heartbeat.t_ns <= self.timing.mode_known_ns
        return is_linked and is_after_silence and is_recent

    @property
    def has_heartbeat(self) -> bool:
        """Whether any heartbeat was received."""
        return self.heartbeat.t_ns != NEVER

    @property
    def is_offboard(self) -> bool:
        """Whether the last heartbeat showed OFFBOARD."""
        return self.heartbeat.mode is VehicleMode.OFFBOARD

    @property
    def is_armed(self) -> bool:
        """Whether the last heartbeat showed the vehicle armed."""
        return self.heartbeat.armed

    @property
    def is_flying(self) -> bool:
        """Whether the vehicle is armed and in the air."""
        return self.is_armed and self.landed.in_air


def link_fault(vehicle: VehicleMonitor, config: GateConfig, now_ns: int) -> Fault | None:
    """Name what is missing of the stream from the autopilot."""
    timing = config.timing
    if now_ns - vehicle.heartbeat.t_ns > timing.heartbeat_age_ns:
        return Cause.HEARTBEAT_LOST, _ago(vehicle.heartbeat.t_ns, now_ns)
    streams = (
        ("attitude", vehicle.attitude.t_ns, timing.telemetry_age_ns),
        ("position", vehicle.position.t_ns, timing.telemetry_age_ns),
        ("estimator's flags", vehicle.estimator.t_ns, timing.status_age_ns),
        ("sensors and battery", vehicle.health.t_ns, timing.status_age_ns),
        ("landed state", vehicle.landed.t_ns, timing.status_age_ns),
    )
    for name, t_ns, age_ns in streams:
        if now_ns - t_ns > age_ns:
            return Cause.TELEMETRY_LOST, f"{name}, {_ago(t_ns, now_ns)}"
    return None


def monitor_fault(vehicle: VehicleMonitor, config: GateConfig, now_ns: int) -> Fault | None:
    """Say that other commanders, or the vehicle's parameters, are not watched any more."""
    if vehicle.other_commanders.monitor_failure:
        return Cause.WATCH_LOST, vehicle.other_commanders.monitor_failure
    received_ns = vehicle.other_commanders.services.t_ns
    if now_ns - received_ns > config.timing.services_age_ns:
        return Cause.WATCH_LOST, f"other services, {_ago(received_ns, now_ns)}"
    return None


def parameters_fault(vehicle: VehicleMonitor, config: GateConfig, now_ns: int) -> Fault | None:
    """Say that the last reading of the parameters is refused, or too long ago."""
    if vehicle.parameters.refusals:
        return Cause.PARAMETERS_REFUSED, "; ".join(vehicle.parameters.refusals)
    read_ns = vehicle.parameters.t_ns
    if now_ns - read_ns > config.timing.parameters_age_ns:
        return Cause.WATCH_LOST, f"failsafe parameters, {_ago(read_ns, now_ns)}"
    return None


def estimate_fault(vehicle: VehicleMonitor, config: GateConfig) -> Fault | None:
    """Name what is wrong with the autopilot's estimate of its own motion."""
    if not _is_finite_attitude(vehicle.attitude):
        return Cause.ESTIMATOR_INVALID, "attitude is not finite"
    if not _is_finite_position(vehicle.position):
        return Cause.ESTIMATOR_INVALID, "position or velocity is not finite"
    if not vehicle.estimator.valid:
        return Cause.ESTIMATOR_INVALID, vehicle.estimator.detail
    if vehicle.jump_m > config.max_jump_m:
        return Cause.ESTIMATOR_JUMP, f"by {vehicle.jump_m:.2f} m"
    return None


def battery_fault(vehicle: VehicleMonitor, config: GateConfig) -> Fault | None:
    """Say that the battery is low, or that its charge is unknown where a limit is set."""
    if config.min_battery <= 0:
        return None
    remaining = vehicle.battery.remaining
    if remaining is None:
        return Cause.BATTERY_LOW, "charge unknown"
    if not remaining >= config.min_battery:
        return Cause.BATTERY_LOW, f"{remaining:.0%} left, {config.min_battery:.0%} needed"
    return None


def flight_fault(vehicle: VehicleMonitor, config: GateConfig, now_ns: int) -> Fault | None:
    """Name the first thing about the vehicle that must end an engagement."""
    if fault := link_fault(vehicle, config, now_ns) or estimate_fault(vehicle, config):
        return fault
    if fault := battery_fault(vehicle, config):
        return fault
    if vehicle.heartbeat.failsafe:
        return Cause.FAILSAFE, f"in mode {vehicle.heartbeat.mode}"
    if vehicle.landed.on_ground:
        return Cause.LANDED, ""
    return None


def _ago(t_ns: int, now_ns: int) -> str:
    return _NOT_RECEIVED if t_ns == NEVER else f"last one {(now_ns - t_ns) / S:.2f} s ago"


def _is_finite_attitude(attitude: Attitude) -> bool:
    return all(math.isfinite(v) for v in (attitude.roll_rad, attitude.pitch_rad, attitude.yaw_rad))


def _is_finite_position(position: LocalPosition) -> bool:
    return all(math.isfinite(v) for v in (*position.position_m, *position.velocity_m_s))
