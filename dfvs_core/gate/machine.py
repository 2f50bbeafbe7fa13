"""The gate's state machine.

``step`` takes the events since the last step and the monotonic time, and says what to send. The
machine is deterministic: the same events and times give the same outputs, so that a recorded
flight can be replayed. It has no word for arming or taking off.

Rules that hold in every state:

- A setpoint that is not zero leaves only in SERVO, saturated and slew-limited from the last one.
- Going to zero is not slew-limited: on a fault the brake is immediate.
- A heartbeat is judged in the order of arrival, before anything is sent in that step: one that
  shows a takeover silences the gate at once, even if the next one shows OFFBOARD again. The
  autopilot re-enters OFFBOARD by itself when setpoints resume, so RELEASED is latched.
- The autopilot's acknowledgements prove nothing; its mode is what its heartbeat says.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Sequence

from dfvs_core.gate.config import MS, Engage, GateConfig, OnDone, S
from dfvs_core.gate.engagement import Engagement, begin, cap, offer
from dfvs_core.gate.events import (
    Action,
    BadReport,
    Event,
    GateOutput,
    Heartbeat,
    ModeRequest,
    Order,
    Report,
    Stop,
    VehicleMode,
)
from dfvs_core.gate.limits import ZERO, BodyVelocity, saturate, slew
from dfvs_core.gate.preflight import Check, failures, preflight
from dfvs_core.gate.proof import MotionProof
from dfvs_core.gate.sight import Sight
from dfvs_core.gate.states import ENGAGED, Cause, GateState, Transition
from dfvs_core.gate.vehicle import Fault, VehiclePicture, flight_fault

_FLYING = frozenset({GateState.ENGAGE, GateState.SERVO, GateState.HOLD})


class GateMachine:
    """Decides, at every step, whether and how fast the vehicle may move."""

    def __init__(self, config: GateConfig, t_ns: int) -> None:
        self.config = config
        self.state = GateState.IDLE
        self.reason = ""
        self.has_reached = False
        """The goal was reached in the last engagement."""
        self.vehicle = VehiclePicture()
        self.sight = Sight(config.timing)
        self.setpoint = ZERO
        """The setpoint that was last sent."""
        self.is_silent = True
        """Nothing more will be sent in this state."""
        self._now = t_ns
        self._since = t_ns
        self._sent_ns: int | None = None
        self._ok_since: int | None = None
        self._failing_since: int | None = None
        self._order_ns: int | None = None
        self._hold_asked = False
        self._engagement = begin(self.vehicle, t_ns)
        self._transitions: list[Transition] = []
        self._request: ModeRequest | None = None

    @property
    def is_finished(self) -> bool:
        """Tell whether the flight is over: only an operator's order can lead on from here."""
        ended = (GateState.DONE, GateState.ABORT, GateState.RELEASED)
        return self.is_silent and self.state in ended

    @property
    def distance_m(self) -> float:
        """Distance from where the gate was engaged last."""
        return math.dist(self.vehicle.position.position_m, self._engagement.start_m)

    def checks(self) -> tuple[Check, ...]:
        """Preflight list of this moment."""
        listed = preflight(self.vehicle, self.sight, self.config, self._now)
        foreign = self.vehicle.is_offboard and self.vehicle.is_armed
        if self.state is GateState.READY and self.config.engage is Engage.PILOT:
            foreign = False
        detail = "the vehicle is in OFFBOARD, but not by this service" if foreign else ""
        return (*listed, Check("sole commander", not foreign, detail))

    def step(self, t_ns: int, events: Sequence[Event] = ()) -> GateOutput:
        """Take the events since the last step; say what to send and what to log.

        Parameters
        ----------
        t_ns : int
            Monotonic time; a time before the last step's counts as the last step's.
        events : sequence of Event
            In the order of arrival.
        """
        pause, self._now = t_ns - self._now, max(self._now, t_ns)
        self._transitions = []
        self._request = None
        if pause > self.config.timing.stall_ns:
            self.sight.spoil("gate stalled")
            self._hold_servo((Cause.GATE_STALLED, f"for {pause / MS:.0f} ms"))
        for event in events:
            self._take(event)
        self._judge()
        return GateOutput(self._stream(), self._request, tuple(self._transitions))

    # --- events ---------------------------------------------------------------------------

    def _take(self, event: Event) -> None:
        if event.t_ns > self._now:
            event = dataclasses.replace(event, t_ns=self._now)
        match event:
            case Heartbeat():
                self.vehicle.take(event)
                self._take_heartbeat(event)
            case Report():
                self._take_report(event)
            case BadReport():
                self.sight.spoil(event.detail)
                self._hold_servo((Cause.REPORT_REJECTED, event.detail))
            case Order():
                self._take_order(event.action)
            case Stop():
                if self.state not in (GateState.ABORT, GateState.RELEASED):
                    cause = Cause.UNSUPERVISED if event.unsupervised else Cause.STOPPED
                    self._abort((cause, event.detail))
            case _:
                self.vehicle.take(event)

    def _take_heartbeat(self, heartbeat: Heartbeat) -> None:
        offboard = heartbeat.mode is VehicleMode.OFFBOARD
        if self.state is GateState.IDLE:
            self._go(GateState.PREFLIGHT, (Cause.VEHICLE_HEARD, ""))
        elif self.state is GateState.PREFLIGHT and not self.is_silent:
            if offboard and heartbeat.armed:
                self._abort((Cause.OFFBOARD_NOT_READY, failures(self.checks())))
        elif self.state is GateState.ABORT:
            self.is_silent = self.is_silent or not (offboard and heartbeat.armed)
        elif self.state in ENGAGED:
            self._take_engaged_heartbeat(heartbeat, self._engagement)

    def _take_engaged_heartbeat(self, heartbeat: Heartbeat, engagement: Engagement) -> None:
        mode = heartbeat.mode
        if self.state is GateState.DONE and engagement.handed_over:
            return
        if not heartbeat.armed:
            self._release((Cause.DISARMED, ""))
        elif mode is VehicleMode.OFFBOARD:
            engagement.is_confirmed = True
        elif engagement.hold_requested and mode is VehicleMode.HOLD:
            engagement.handed_over = True
            self.is_silent = True
        elif engagement.is_confirmed or mode is not engagement.mode_before:
            self._release((Cause.TAKEOVER, f"to {mode}"))

    def _take_report(self, event: Report) -> None:
        fault = self.sight.take(event.report, event.t_ns)
        if event.report.lost and self.state in _FLYING:
            self._abort((Cause.GOAL_LOST, event.report.reason))
        elif fault is not None:
            self._hold_servo(fault)
        elif self.state is GateState.SERVO and self._engagement.proof is not None:
            self._engagement.proof.see(event.report)

    def _take_order(self, action: Action) -> None:
        engagement = self._engagement
        if action is Action.ABORT:
            if self.state not in (GateState.ABORT, GateState.RELEASED):
                self._abort((Cause.OPERATOR_ABORT, ""))
        elif action is Action.HOLD:
            self._order_ns = None
            if self.state in _FLYING:
                engagement.is_held = True
                self._hold_servo((Cause.OPERATOR_HOLD, ""))
        elif self.is_finished:
            self._order_ns = self._now
            self._go(GateState.PREFLIGHT, (Cause.OPERATOR_AGAIN, ""))
        elif self.state in (GateState.PREFLIGHT, GateState.READY):
            self._order_ns = self._now
        elif self.state in _FLYING and engagement.is_held:
            engagement.is_held = False
            self._since = self._now

    # --- judgement ------------------------------------------------------------------------

    def _judge(self) -> None:
        match self.state:
            case GateState.PREFLIGHT:
                self._judge_preflight()
            case GateState.READY:
                self._judge_ready()
            case GateState.ENGAGE | GateState.SERVO | GateState.HOLD | GateState.DONE:
                self._judge_engaged(self._engagement)
            case _:
                pass
        if self.state is GateState.ABORT:
            self._judge_abort()

    def _judge_preflight(self) -> None:
        problem = failures(self.checks())
        self.vehicle.jump_m = 0.0
        self.reason = problem or "checks pass"
        if self._elapsed(self._since) > self.config.timing.mode_known_ns:
            self.is_silent = True
        if problem:
            self._ok_since = None
        elif self._ok_since is None:
            self._ok_since = self._now
        elif self._elapsed(self._ok_since) >= self.config.timing.ready_after_ns:
            self._go(GateState.READY, (Cause.CHECKS_PASSED, ""))

    def _judge_ready(self) -> None:
        problem = failures(self.checks())
        self.vehicle.jump_m = 0.0
        if not problem:
            self._failing_since = None
        elif self._failing_since is None:
            self._failing_since = self._now
        elif self._elapsed(self._failing_since) >= self.config.timing.ready_grace_ns:
            self._go(GateState.PREFLIGHT, (Cause.CHECKS_FAILED, problem))
            return
        cause = offer(self.vehicle, self.config, self._is_ordered())
        if cause is not None and (cause is Cause.PILOT_ENGAGED or not problem):
            self._engagement = begin(self.vehicle, self._now)
            self._go(GateState.ENGAGE, (cause, ""))

    def _is_ordered(self) -> bool:
        valid_ns = self.config.timing.order_valid_ns
        return self._order_ns is not None and self._elapsed(self._order_ns) <= valid_ns

    def _judge_engaged(self, engagement: Engagement) -> None:
        if engagement.handed_over:
            return
        fault = flight_fault(self.vehicle, self.config, self._now)
        if fault is None and self.state is not GateState.DONE:
            fault = cap(engagement, self.vehicle, self.config, self._now)
        if fault is not None:
            self._abort(fault)
        elif self.state is GateState.ENGAGE:
            self._judge_engage(engagement)
        elif self.state is GateState.SERVO:
            self._judge_servo(engagement)
        elif self.state is GateState.HOLD:
            self._judge_hold(engagement)

    def _judge_engage(self, engagement: Engagement) -> None:
        timing = self.config.timing
        if self._elapsed(self._since) < timing.engage_zero_ns:
            return
        if engagement.is_confirmed:
            self._start_servo(engagement, (Cause.OFFBOARD_CONFIRMED, ""))
        elif engagement.requested_ns is None:
            engagement.requested_ns = self._now
            self._request = ModeRequest.OFFBOARD
        elif self._elapsed(engagement.requested_ns) > timing.confirm_ns:
            self._abort((Cause.OFFBOARD_NOT_CONFIRMED, f"within {timing.confirm_ns / S:g} s"))

    def _start_servo(self, engagement: Engagement, cause: Fault) -> None:
        if engagement.is_held:
            self._go(GateState.HOLD, (Cause.OPERATOR_HOLD, ""))
        elif (stale := self.sight.stale(self._now)) is not None:
            self._go(GateState.HOLD, stale)
        else:
            needs_proof = not engagement.is_proven and self.config.timing.proof_ns > 0
            engagement.proof = MotionProof(self._now) if needs_proof else None
            self._go(GateState.SERVO, cause)

    def _judge_servo(self, engagement: Engagement) -> None:
        timing = self.config.timing
        if (stale := self.sight.stale(self._now)) is not None:
            self._hold_servo(stale)
        elif self._servo_reached():
            self._finish(engagement)
        elif (proof := engagement.proof) is not None:
            if self._elapsed(proof.start_ns) < timing.proof_ns:
                return
            if (objection := proof.objection()) is not None:
                self._abort((Cause.ERROR_NOT_FALLING, objection))
            engagement.proof = None
            engagement.is_proven = True

    def _servo_reached(self) -> bool:
        reached_ns = min(self.sight.reached_for_ns(self._now), self._elapsed(self._since))
        return reached_ns >= self.config.timing.reached_ns

    def _finish(self, engagement: Engagement) -> None:
        self.has_reached = True
        self._go(GateState.DONE, (Cause.GOAL_REACHED, ""))
        if self.config.on_done is OnDone.HOLD:
            engagement.hold_requested = True
            self._request = ModeRequest.HOLD

    def _judge_hold(self, engagement: Engagement) -> None:
        timing = self.config.timing
        stale = self.sight.stale(self._now)
        if engagement.is_held:
            return
        if self._elapsed(self._since) > timing.hold_ns:
            self._abort((Cause.HOLD_TOO_LONG, self.reason))
        elif stale is None and self.sight.good_for_ns(self._now) >= timing.good_data_ns:
            self._start_servo(engagement, (Cause.DATA_GOOD, ""))

    def _judge_abort(self) -> None:
        timing = self.config.timing
        if self._elapsed(self._since) > timing.mode_known_ns:
            self.is_silent = True
        heartbeat = self.vehicle.heartbeat
        if self.is_silent or self._hold_asked:
            return
        is_known = self._elapsed(heartbeat.t_ns) <= timing.mode_known_ns
        if self.vehicle.is_offboard and self.vehicle.is_armed and is_known:
            self._hold_asked = True
            self._request = ModeRequest.HOLD

    # --- transitions ----------------------------------------------------------------------

    def _elapsed(self, t_ns: int) -> int:
        return self._now - t_ns

    def _go(self, target: GateState, cause: Fault) -> None:
        """Change the state, log why, and forget what belongs to the old state."""
        record = Transition(self._now, self.state, target, cause[0], cause[1])
        self._transitions.append(record)
        pilots = self.config.engage is Engage.PILOT
        if target is GateState.PREFLIGHT and self.state is not GateState.READY:
            self.is_silent = True
        elif target is GateState.READY:
            self.is_silent = not pilots
        elif target in _FLYING:
            self.is_silent = False
        if target is GateState.ENGAGE:
            self.has_reached = False
            self._order_ns = None
        self.state = target
        self.reason = record.reason
        self._since = self._now
        self._ok_since = None
        self._failing_since = None

    def _hold_servo(self, cause: Fault) -> None:
        if self.state is GateState.SERVO:
            self._go(GateState.HOLD, cause)

    def _abort(self, cause: Fault) -> None:
        self._request = None
        self._hold_asked = False
        self._go(GateState.ABORT, cause)

    def _release(self, cause: Fault) -> None:
        self._request = None
        self._go(GateState.RELEASED, cause)
        self.is_silent = True

    # --- setpoints ------------------------------------------------------------------------

    def _stream(self) -> BodyVelocity | None:
        """Return the setpoint of this step, None where none is due or none may be sent."""
        if self.is_silent:
            self.setpoint = ZERO
            self._sent_ns = None
            return None
        gap_ns = (
            self.config.timing.stall_ns if self._sent_ns is None else self._elapsed(self._sent_ns)
        )
        brakes = self.state is not GateState.SERVO and self.setpoint != ZERO
        if gap_ns < self.config.timing.setpoint_gap_ns and not brakes:
            return None
        self.setpoint = self._servo_velocity(gap_ns) if self.state is GateState.SERVO else ZERO
        self._sent_ns = self._now
        return self.setpoint

    def _servo_velocity(self, gap_ns: int) -> BodyVelocity:
        """Velocity that perception asks for, within speed and slew limits."""
        limits = self.config.velocity
        proof = self._engagement.proof
        if proof is not None:
            limits = limits.capped(self.config.proof_speed_m_s)
        dt_s = min(gap_ns, self.config.timing.stall_ns) / S
        setpoint = slew(self.setpoint, saturate(self.sight.velocity(), limits), dt_s, limits)
        if proof is not None:
            proof.move(setpoint, dt_s)
        return setpoint
