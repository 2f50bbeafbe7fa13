"""State machine of the gate.

``step`` takes the events since the last step and the monotonic time, and returns what to send. The
machine is deterministic: the same events and times give the same outputs, so that a recorded
flight can be replayed. It has no word for arming or taking off.

Rules that hold in every state:

- A setpoint that is not zero leaves only in SERVO, and in DONE where the goal is held by vision,
  saturated and slew-limited from the last one.
- Going to zero is not slew-limited: on a fault the brake is immediate.
- A heartbeat is judged in the order of arrival, before anything is sent in that step: one that
  shows a takeover silences the gate at once, even if the next one shows OFFBOARD again. The
  autopilot re-enters OFFBOARD by itself when setpoints resume, so RELEASED is latched.
- Acknowledgements prove nothing; the autopilot's mode is that of its heartbeat.
"""

import dataclasses
from collections.abc import Sequence

from dfvs_core.gate.checks.preflight import failures
from dfvs_core.gate.config import MS, Engage, OnDone
from dfvs_core.gate.engagement import begin, offer
from dfvs_core.gate.events import (
    Action,
    BadReport,
    CurrentMode,
    Event,
    GateOutput,
    Heartbeat,
    ModeRequest,
    OperatorCommand,
    Report,
    Stop,
    VehicleMode,
)
from dfvs_core.gate.flight import Moment, decide, held_reason
from dfvs_core.gate.states import ENGAGED, FLYING, Cause, GateState
from dfvs_core.gate.transitions import TransitionState
from dfvs_core.gate.vehicle import Fault

_WAITING = frozenset({GateState.PREFLIGHT, GateState.READY})
"""States in which the gate may wait for a command to engage."""

_ENGAGED_BY = {
    Engage.PILOT: "the pilot selects OFFBOARD",
    Engage.AUTO: "it engages once the vehicle flies in Hold",
    Engage.NEVER: "nothing is flown",
}
_NO_ENGAGE_IN = {
    GateState.IDLE: "no vehicle heard",
    GateState.ABORT: "the flight is still being ended, command it again",
    GateState.DONE: "the goal is reached, send another goal",
}
"""Why a command to engage does nothing."""

_NO_HOLD_IN = {
    **dict.fromkeys((GateState.IDLE, *_WAITING), "nothing is flown yet, command abort to end this"),
    GateState.DONE: "nothing moves at the goal until another one is sent",
    GateState.ABORT: "the flight is ended already",
    GateState.RELEASED: "the vehicle is not flown any more",
}
"""Why a command to hold does nothing."""


class GateMachine(TransitionState):
    """Decides, at every step, whether and how fast the vehicle may move.

    Parameters
    ----------
    config : GateConfig
        Limits, times, and how to engage and end.
    t_ns : int
        Monotonic time of the start.
    """

    def step(self, t_ns: int, events: Sequence[Event] = ()) -> GateOutput:
        """Take the events since the last step; returns what to send and what to log.

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
        self._refusal = ""
        if pause > self.config.timing.stall_ns:
            self._invalidate_perception((Cause.GATE_STALLED, f"for {pause / MS:.0f} ms"))
        for event in events:
            self._on_event(event)
        self._evaluate()
        setpoint, changes = self._next_setpoint(), tuple(self._transitions)
        return GateOutput(setpoint, self._request, changes, self._refusal)

    # --- events ---------------------------------------------------------------------------

    def _on_event(self, event: Event) -> None:
        if event.t_ns > self._now:
            event = dataclasses.replace(event, t_ns=self._now)
        match event:
            case Heartbeat() | CurrentMode():
                self.vehicle.update(event)
                if self.vehicle.has_heartbeat:
                    self._on_mode(self.vehicle.heartbeat)
            case Report():
                self._on_report(event)
            case BadReport():
                self._invalidate_perception((Cause.REPORT_REJECTED, event.detail))
            case OperatorCommand():
                self._on_command(event)
            case Stop():
                self._is_stopped = True
                cause = Cause.UNSUPERVISED if event.unsupervised else Cause.STOPPED
                self._abort((cause, event.detail))
            case _:
                self.vehicle.update(event)

    def _on_mode(self, heartbeat: Heartbeat) -> None:
        flies_offboard = heartbeat.mode is VehicleMode.OFFBOARD and heartbeat.armed
        if self.state is GateState.IDLE:
            self._go(GateState.PREFLIGHT, (Cause.HEARTBEAT_RECEIVED, ""))
        elif self.state is GateState.PREFLIGHT and not self.stream.is_silent:
            if flies_offboard:
                self._abort((Cause.OFFBOARD_NOT_READY, failures(self.checks())))
        elif self.state is GateState.ABORT and not flies_offboard:
            self.stream.silence()
        elif self.state in ENGAGED:
            if (loss := self._engagement.on_heartbeat(heartbeat)) is not None:
                self._go(GateState.RELEASED, loss)
            elif self._engagement.handed_over:
                self.stream.silence()

    def _on_report(self, event: Report) -> None:
        fault = self.perception.update(event.report, event.t_ns)
        is_fresh = self.perception.good is event.report
        if self.perception.lost and (self.state in FLYING or self._holds_visually):
            self._abort((Cause.GOAL_LOST, event.report.reason))
        elif fault is not None:
            self._hold_servo(fault)
        elif is_fresh and self._engagement.response is not None:
            self._update_response(self._engagement.response, event.report)

    def _on_command(self, command: OperatorCommand) -> None:
        action = command.action
        if action is Action.GOAL:
            self._on_goal(command.argument)
        elif action is Action.ABORT:
            self._abort((Cause.OPERATOR_ABORT, ""))
        elif action is Action.HOLD:
            self._on_hold()
        else:
            self._on_engage()

    def _on_hold(self) -> None:
        """Hold, or take a command to engage back."""
        takes_back = self.config.engage is Engage.COMMAND and self._is_commanded()
        self._commanded_ns = None
        self._engagement.is_held = self.state in FLYING or self._holds_visually
        self._hold_servo((Cause.OPERATOR_HOLD, ""))
        if self.state in _NO_HOLD_IN and not (takes_back and self.state in _WAITING):
            self._refusal = f"rejected: {_NO_HOLD_IN[self.state]}"

    def _on_engage(self) -> None:
        if self._is_stopped:
            self._refusal = "rejected: the service is being ended"
        elif self.is_finished:
            self._commanded_ns = self._now
            self._go(GateState.PREFLIGHT, (Cause.OPERATOR_AGAIN, ""))
        elif self.state in _WAITING and self.config.engage is Engage.COMMAND:
            self._commanded_ns = self._now
        elif self.state in FLYING and self._engagement.is_held:
            self._engagement.is_held = False
            self._since = self._now
        elif self.state in _WAITING:
            engage = self.config.engage
            self._refusal = f"rejected: gate.engage is {engage}: {_ENGAGED_BY[engage]}"
        else:
            self._refusal = f"rejected: {_NO_ENGAGE_IN.get(self.state, 'already engaged')}"

    def _on_goal(self, goal: str) -> None:
        """Set another goal, where nothing moves: checks, overlap and response begin anew."""
        hands_over = self._engagement.hold_requested and not self._engagement.handed_over
        is_done = self.state is GateState.DONE
        if self.state in (GateState.ENGAGE, GateState.SERVO) or (is_done and hands_over):
            remedy = "send it again once the autopilot holds" if is_done else "command hold first"
            self._refusal = f"rejected: the goal cannot change in {self.state}, {remedy}"
            return
        cause = (Cause.OPERATOR_GOAL, goal[:12])
        self.perception.set_goal(goal, cause)
        if self.state is GateState.READY:
            self._go(GateState.PREFLIGHT, cause)
        elif self.state is GateState.HOLD:
            self._restart_engagement()
            self._engagement.is_confirmed_response = False
            self._engagement.response = None
            self._since = self._now
        elif is_done and not self.stream.is_silent:
            self._restart_engagement()
            self._go(GateState.HOLD, cause)
        self.has_reached = False

    def _restart_engagement(self) -> None:
        """Begin another engagement where the goal of this one was reached."""
        if self.has_reached:
            is_held = self._engagement.is_held
            self._engagement = begin(self.vehicle, self._now)
            self._engagement.is_held = is_held

    def _invalidate_perception(self, fault: Fault) -> None:
        """Invalidate the last report, and stop."""
        self.perception.invalidate(fault)
        self._hold_servo(fault)

    # --- judgement ------------------------------------------------------------------------

    def _evaluate(self) -> None:
        self.perception.stale(self._now)
        if self.state is GateState.PREFLIGHT:
            self._evaluate_preflight()
        elif self.state is GateState.READY:
            self._evaluate_ready()
        elif self.state in ENGAGED:
            self._evaluate_engaged()
        if self.state is GateState.ABORT:
            self._evaluate_abort()

    def _evaluate_preflight(self) -> None:
        problem = self._problem()
        self.reason = problem or "checks pass"
        if self._elapsed(self._since) > self.config.timing.mode_known_ns:
            self.stream.silence()
        if problem:
            self._passing_since = None
        elif self._passing_since is None:
            self._passing_since = self._now
        elif self._elapsed(self._passing_since) >= self.config.timing.ready_after_ns:
            self._go(GateState.READY, (Cause.CHECKS_PASSED, ""))

    def _evaluate_ready(self) -> None:
        problem = self._problem()
        if not problem:
            self._failing_since = None
        elif self._failing_since is None:
            self._failing_since = self._now
        elif self._elapsed(self._failing_since) >= self.config.timing.ready_grace_ns:
            self._go(GateState.PREFLIGHT, (Cause.CHECKS_FAILED, problem))
            return
        cause = offer(self.vehicle, self.config, self._is_commanded())
        if cause is not None and (cause is Cause.PILOT_ENGAGED or not problem):
            self._go(GateState.ENGAGE, (cause, ""))
        else:
            self.reason = self._ready_reason(problem)

    def _problem(self) -> str:
        """One line of failed checks; a jump of the position counts once while not engaged."""
        problem = failures(self.checks())
        self.vehicle.jump_m = 0.0
        return problem

    def _evaluate_engaged(self) -> None:
        times = self._now, self._elapsed(self._since)
        moment = Moment(*times, self.state, self.vehicle, self.perception, self.config)
        decision = decide(self._engagement, moment)
        if decision is not None:
            self._go(decision.target, decision.cause)
        elif self.state is GateState.HOLD and self._engagement.is_held:
            self.reason = held_reason(moment)
        if self.vehicle.is_mode_known(self._now):
            self._request_mode()

    def _request_mode(self) -> None:
        """OFFBOARD, once, after zeros have streamed; Hold, once, where the goal is reached."""
        engagement = self._engagement
        is_to_hold = self.state is GateState.DONE and self.config.on_done is OnDone.HOLD
        if self.state is GateState.ENGAGE and not engagement.is_confirmed:
            zeros_streamed = self._elapsed(self._since) >= self.config.timing.engage_zero_ns
            if zeros_streamed and engagement.requested_ns is None:
                engagement.requested_ns = self._now
                self._request = ModeRequest.OFFBOARD
        elif is_to_hold and not engagement.hold_requested:
            engagement.hold_requested = True
            self._request = ModeRequest.HOLD

    def _evaluate_abort(self) -> None:
        """Zeros until a heartbeat shows the mode; Hold, once, where that surely is OFFBOARD."""
        if self._elapsed(self._since) > self.config.timing.mode_known_ns:
            self.stream.silence()
        vehicle = self.vehicle
        is_offboard_known = (
            vehicle.is_offboard and vehicle.is_armed and vehicle.is_mode_known(self._now)
        )
        if is_offboard_known and not self.stream.is_silent and not self._is_hold_requested:
            self._is_hold_requested = True
            self._request = ModeRequest.HOLD
