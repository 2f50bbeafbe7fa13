"""A gate with a clock in hand: a vehicle and a perception that behave, until told otherwise."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Sequence
from dataclasses import dataclass, field

from dfvs_core.gate.config import MS, Engage, GateConfig, GateTiming, S
from dfvs_core.gate.events import (
    Action,
    Attitude,
    Battery,
    CurrentMode,
    EstimatorState,
    Event,
    GateOutput,
    Health,
    Heartbeat,
    LandedState,
    LocalPosition,
    ModeRequest,
    OperatorCommand,
    OtherServices,
    ParametersRead,
    Report,
    VehicleMode,
)
from dfvs_core.gate.limits import ZERO, BodyVelocity
from dfvs_core.gate.machine import GateMachine
from dfvs_core.gate.states import GateState, Transition
from dfvs_core.messages.link import PerceptionReport

TICK_NS = 20 * MS
START_NS = 1_000 * S


@dataclass
class Vehicle:
    """What the autopilot tells; None silences that message."""

    mode: VehicleMode = VehicleMode.HOLD
    armed: bool = True
    failsafe: bool = False
    in_air: bool = True
    battery: float | None = 0.9
    healthy: bool = True
    can_arm: bool = True
    doubts_estimate: bool = False
    """SYS_STATUS lacks the bit of the estimate, and no other."""
    position_m: tuple[float, float, float] = (1.0, 2.0, -3.0)
    velocity_m_s: tuple[float, float, float] = (0.0, 0.0, 0.0)
    roll_rad: float = 0.0
    sends_heartbeat: bool = True
    sends_attitude: bool = True
    sends_position: bool = True
    sends_status: bool = True
    parameters_told: bool = True
    others_watched: bool = True
    obeys: bool = True
    follows: float = 1.0
    """Share of a setpoint that it flies, at once."""


@dataclass
class Rehearsal:
    """Steps a gate every 20 ms; keeps what it sent and logged."""

    config: GateConfig = field(default_factory=lambda: GateConfig(engage=Engage.AUTO))
    now_ns: int = START_NS
    vehicle: Vehicle = field(default_factory=Vehicle)
    sees: bool = True
    asked: tuple[float, float, float, float] = (0.4, 0.0, 0.0, 0.0)
    error_m: float = 1.0
    fall_m_s: float = 0.05
    latency_ns: int = 40 * MS
    changes: dict[str, object] = field(default_factory=dict)
    others: tuple[tuple[str, ...], ...] = ()
    """Other services: those that stand by, and those that are engaged."""
    follows_goal: bool = True
    """Perception looks for the goal that was ordered."""
    setpoints: list[tuple[int, BodyVelocity]] = field(default_factory=list)
    requests: list[tuple[int, ModeRequest]] = field(default_factory=list)
    transitions: list[Transition] = field(default_factory=list)

    def __post_init__(self) -> None:
        self.machine = GateMachine(self.config, self.now_ns)
        self._seq = 0
        self._beat_ns = self.now_ns
        self.flown = ZERO
        """Velocity that the vehicle flies, on top of ``vehicle.velocity_m_s``."""
        self.yaw_rad = 0.0

    @property
    def state(self) -> GateState:
        return self.machine.state

    def heartbeat(self) -> Heartbeat:
        v = self.vehicle
        return Heartbeat(self.now_ns, v.mode, v.armed, v.failsafe)

    def health(self) -> Health:
        v = self.vehicle
        names = () if v.healthy else ("gyroscope",)
        names += ("attitude and position estimate",) if v.doubts_estimate else ()
        detail = f"not healthy: {', '.join(names)}" if names else ""
        only_estimate = v.doubts_estimate and v.healthy
        return Health(self.now_ns, not names, detail, v.can_arm, only_estimate)

    def report(self, **changes: object) -> Report:
        self._seq += 1
        report = PerceptionReport(
            seq=self._seq,
            t_capture_ns=self.now_ns - self.latency_ns,
            velocity=self.asked,
            healthy=True,
            reached=False,
            lost=False,
            reason="",
            error_m=self.error_m,
            error_rad=0.1,
            overlap=0.8,
            goal=self.machine.perception.goal if self.follows_goal else "",
        )
        return Report(self.now_ns, dataclasses.replace(report, **{**self.changes, **changes}))

    def velocity_ned(self) -> tuple[float, float, float]:
        """What the vehicle says of its own velocity."""
        north, east, down = self.vehicle.velocity_m_s
        c, s, f = math.cos(self.yaw_rad), math.sin(self.yaw_rad), self.flown
        return (
            north + c * f.forward_m_s - s * f.right_m_s,
            east + s * f.forward_m_s + c * f.right_m_s,
            down + f.down_m_s,
        )

    def nominal(self) -> list[Event]:
        """Everything that arrives in one tick of an undisturbed flight."""
        v, now = self.vehicle, self.now_ns
        events: list[Event] = [ParametersRead(now)] if v.parameters_told else []
        if v.others_watched:
            events.append(OtherServices(now, *self.others))
        if v.sends_status:
            events += [
                LandedState(now, v.in_air, not v.in_air),
                Battery(now, v.battery),
                self.health(),
                EstimatorState(now, valid=True),
            ]
        if v.sends_attitude:
            events.append(Attitude(now, v.roll_rad, 0.0, self.yaw_rad))
        if v.sends_position:
            events.append(LocalPosition(now, v.position_m, self.velocity_ned()))
        if v.sends_heartbeat and now - self._beat_ns >= S:
            self._beat_ns = now
            events.append(self.heartbeat())
        if self.sees:
            events.append(self.report())
        return events

    def tick(self, *extra: Event) -> GateOutput:
        """One undisturbed tick, and what else arrives in it."""
        self.now_ns += TICK_NS
        self.yaw_rad += self.flown.yaw_rad_s * TICK_NS / S
        if self.state is GateState.SERVO:
            self.error_m = max(self.error_m - self.fall_m_s * TICK_NS / S, 0.0)
        return self.send([*self.nominal(), *extra])

    def command(self, action: Action, argument: str = "") -> GateOutput:
        """One undisturbed tick in which an operator's command arrives."""
        return self.tick(OperatorCommand(self.now_ns, action, argument))

    def look(self, **changes: object) -> GateOutput:
        """A report alone, 5 ms after the last step."""
        self.now_ns += 5 * MS
        return self.send([self.report(**changes)])

    def send(self, events: Sequence[Event]) -> GateOutput:
        """Step at the present time with these events alone."""
        output = self.machine.step(self.now_ns, events)
        if output.setpoint is not None:
            self.setpoints.append((self.now_ns, output.setpoint))
            self.flown = output.setpoint.scaled(self.vehicle.follows)
        if output.mode_request is not None:
            self.requests.append((self.now_ns, output.mode_request))
            if self.vehicle.obeys:
                self.vehicle.mode = VehicleMode(output.mode_request.value)
        self.transitions.extend(output.transitions)
        return output

    def run(self, seconds: float) -> Rehearsal:
        """Run undisturbed for a time."""
        for _ in range(round(seconds * S / TICK_NS)):
            self.tick()
        return self

    def until(self, state: GateState, seconds: float = 15.0) -> Rehearsal:
        """Run undisturbed until a state is reached."""
        for _ in range(round(seconds * S / TICK_NS)):
            if self.state is state:
                return self
            self.tick()
        raise AssertionError(f"{self.state}: {self.machine.reason}; never {state}")

    def beat(self, **changes: object) -> GateOutput:
        """A heartbeat right now, 1 ms after the last step, after changes to the vehicle."""
        for name, value in changes.items():
            setattr(self.vehicle, name, value)
        self.now_ns += MS
        self._beat_ns = self.now_ns
        return self.send([self.heartbeat()])

    def tell_mode(self, mode: VehicleMode) -> GateOutput:
        """CURRENT_MODE right now, 1 ms after the last step, as the autopilot changes its mode."""
        self.vehicle.mode = mode
        self.now_ns += MS
        return self.send([CurrentMode(self.now_ns, mode)])

    def forget(self) -> Rehearsal:
        """Forget what was sent so far."""
        self.setpoints.clear()
        self.requests.clear()
        self.transitions.clear()
        return self

    def moved(self) -> list[int]:
        """Times of setpoints that are not zero."""
        return [t for t, v in self.setpoints if v != ZERO]

    @property
    def last(self) -> Transition:
        return self.transitions[-1]


def pilot_config(**changes: object) -> GateConfig:
    return dataclasses.replace(GateConfig(), **changes)


def auto_config(**changes: object) -> GateConfig:
    return dataclasses.replace(GateConfig(engage=Engage.AUTO), **changes)


NO_CHECK = auto_config(timing=GateTiming(response_ns=0))
"""Without an initial-response check."""


def flying(config: GateConfig = NO_CHECK, **changes: object) -> Rehearsal:
    """A gate in SERVO; without the check at full speed."""
    gate = Rehearsal(config, **changes).until(GateState.SERVO)
    return gate.run(2.0) if config is NO_CHECK else gate


def in_confirmed(state: GateState) -> Rehearsal:
    """A gate in the given state, OFFBOARD confirmed."""
    gate = Rehearsal(pilot_config(timing=GateTiming(response_ns=0))).until(GateState.READY)
    gate.beat(mode=VehicleMode.OFFBOARD)
    if state is not GateState.ENGAGE:
        gate.until(GateState.SERVO)
    if state is GateState.HOLD:
        gate.send([gate.report(healthy=False)])
    if state is GateState.DONE:
        gate.changes = {"reached": True}
        gate.until(GateState.DONE)
    assert gate.state is state
    return gate
