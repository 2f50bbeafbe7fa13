"""The gate's invariants, judged from outside: by what went in and what came out."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

from dfvs_core.gate.config import MS, Engage, GateConfig, S
from dfvs_core.gate.events import (
    Action,
    Event,
    GateOutput,
    Heartbeat,
    ModeRequest,
    Order,
    Report,
    VehicleMode,
)
from dfvs_core.gate.limits import ZERO, BodyVelocity
from dfvs_core.gate.states import ENGAGED, TRANSITIONS, GateState

ROUNDING = 1e-9


@dataclass
class Invariants:
    """Watches a gate step by step and raises at the first violation."""

    config: GateConfig
    stepped_ns: int
    state: GateState = GateState.IDLE
    last: BodyVelocity = ZERO
    sent_ns: int | None = None
    engaged_ns: int = 0
    confirmed: bool = False
    mode: VehicleMode = VehicleMode.OTHER
    awaits_hold: bool = False
    taken_over: bool = False
    newest_healthy_ns: int = -1
    hold_requests: int = 0
    goal: str = ""
    seen: set[GateState] = field(default_factory=set)

    def watch(
        self, now_ns: int, events: Sequence[Event], output: GateOutput, state: GateState
    ) -> None:
        now_ns = max(now_ns, self.stepped_ns)
        self._hear(now_ns, events, refused=bool(output.refusal))
        self._check_log(now_ns, output, state)
        self._check_takeover(output)
        self._check_requests(output, state)
        self._check_setpoint(now_ns, output.setpoint, state)
        self._check_rhythm(now_ns, output, state)
        self._remember(now_ns, output, state)

    def _hear(self, now_ns: int, events: Sequence[Event], *, refused: bool) -> None:
        for event in events:
            if isinstance(event, Heartbeat):
                self._hear_heartbeat(event)
            elif isinstance(event, Report) and self._may_fly_by(event):
                self.newest_healthy_ns = max(
                    self.newest_healthy_ns, min(event.report.t_capture_ns, now_ns + 5 * MS)
                )
            elif isinstance(event, Order) and event.action is Action.ENGAGE:
                self.taken_over = False
            elif isinstance(event, Order) and event.action is Action.GOAL and not refused:
                self.goal, self.newest_healthy_ns = event.argument, -1

    def _may_fly_by(self, event: Report) -> bool:
        return event.report.healthy and event.report.goal == self.goal

    def _hear_heartbeat(self, event: Heartbeat) -> None:
        self.mode = event.mode
        is_ours = event.mode is VehicleMode.OFFBOARD and event.armed
        handed_over = self.awaits_hold and event.mode is VehicleMode.HOLD and event.armed
        if self.state not in ENGAGED or handed_over:
            return
        if is_ours:
            self.confirmed = True
        elif self.confirmed or not event.armed:
            self.taken_over = True

    def _check_log(self, now_ns: int, output: GateOutput, state: GateState) -> None:
        """I9: every change of state is in the log, is allowed, and has its cause."""
        at = self.state
        for change in output.transitions:
            assert change.source is at
            assert change.target in TRANSITIONS[at]
            assert change.t_ns == now_ns
            assert str(change.cause)
            at = change.target
        assert at is state

    def _check_takeover(self, output: GateOutput) -> None:
        """I5: after a takeover silence, until the operator engages again."""
        if self.taken_over:
            assert output.setpoint is None
            assert output.mode_request is None

    def _check_requests(self, output: GateOutput, state: GateState) -> None:
        """I8: OFFBOARD only while engaging, Hold once an end; nothing else can be asked for."""
        request = output.mode_request
        assert request in (None, ModeRequest.OFFBOARD, ModeRequest.HOLD)
        if request is ModeRequest.OFFBOARD:
            assert state is GateState.ENGAGE
            assert self.config.engage is not Engage.PILOT
        if request is ModeRequest.HOLD:
            assert state in (GateState.DONE, GateState.ABORT)
            assert self.mode is VehicleMode.OFFBOARD
            self.hold_requests = 1 if output.transitions else self.hold_requests + 1
            assert self.hold_requests == 1

    def _check_setpoint(self, now_ns: int, v: BodyVelocity | None, state: GateState) -> None:
        """I1, I2, I4: finite, limited, slewed, fresh, and not zero in SERVO alone."""
        if v is None or v == ZERO:
            return
        limits = self.config.velocity
        assert state is GateState.SERVO
        assert v.is_finite()
        assert v.horizontal_m_s <= limits.horizontal_m_s + ROUNDING
        assert abs(v.down_m_s) <= limits.vertical_m_s + ROUNDING
        assert abs(v.yaw_rad_s) <= limits.yaw_rad_s + ROUNDING
        assert self.sent_ns is not None
        dt_s = min((now_ns - self.sent_ns) / S, 0.1)
        change = v.plus(self.last.scaled(-1.0))
        assert change.speed_m_s <= limits.slew_m_s2 * dt_s + ROUNDING
        assert abs(change.yaw_rad_s) <= limits.yaw_slew_rad_s2 * dt_s + ROUNDING
        assert now_ns - self.newest_healthy_ns <= self.config.timing.frame_age_ns
        assert now_ns - self.engaged_ns <= self.config.max_engaged_ns

    def _check_rhythm(self, now_ns: int, output: GateOutput, state: GateState) -> None:
        """I3: whoever steps often enough gets a stream without pauses while engaged."""
        steps_on = now_ns - self.stepped_ns <= 50 * MS
        if state in ENGAGED and self.state in ENGAGED and steps_on and not self.awaits_hold:
            last_ns = now_ns if output.setpoint is not None else self.sent_ns
            assert last_ns is not None
            assert now_ns - last_ns <= 150 * MS

    def _remember(self, now_ns: int, output: GateOutput, state: GateState) -> None:
        if output.transitions and output.mode_request is None:
            self.hold_requests = 0
        for change in output.transitions:
            self.seen.add(change.target)
            if change.target is GateState.ENGAGE:
                self.engaged_ns = now_ns
                self.confirmed = self.mode is VehicleMode.OFFBOARD
                self.awaits_hold = False
            if change.target is GateState.PREFLIGHT:
                self.awaits_hold = False
            if change.source is GateState.DONE and change.target is GateState.HOLD:
                self.engaged_ns = now_ns  # an operator's order begins a new engagement
        if output.mode_request is ModeRequest.HOLD and state is GateState.DONE:
            self.awaits_hold = True
        if output.setpoint is not None:
            self.last, self.sent_ns = output.setpoint, now_ns
        self.state = state
        self.stepped_ns = now_ns
