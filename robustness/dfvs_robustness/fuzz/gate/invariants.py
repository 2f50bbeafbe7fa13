"""The gate's invariants I1 to I9, judged from outside: by what went in and what came out."""

import math
from collections.abc import Sequence

from dfvs_core.gate.config import Engage, GateConfig, OnDone, S
from dfvs_core.gate.events import (
    Action,
    CurrentMode,
    Event,
    GateOutput,
    Heartbeat,
    ModeRequest,
    OperatorCommand,
    VehicleMode,
)
from dfvs_core.gate.limits import ZERO, BodyVelocity
from dfvs_core.gate.states import ENDED, ENGAGED, TRANSITIONS, GateState, Transition
from dfvs_robustness.fuzz.finding import InvariantError
from dfvs_robustness.fuzz.gate.oracle import Oracle
from dfvs_robustness.slew import least_time_s

_ROUNDING = 1e-9
_LONGEST_SLEW_S = 0.1


def _demand(holds: bool, rule: str, text: object) -> None:
    if not holds:
        raise InvariantError(rule, str(text))


class InvariantChecker:
    """Watches a gate from the monotonic t_ns on, and raises at the first violation."""

    def __init__(self, config: GateConfig, t_ns: int) -> None:
        self.config = config
        self.oracle = Oracle(config)
        self.state = GateState.IDLE
        self._stepped_ns = t_ns
        self._last = ZERO
        self._sent_ns: int | None = None
        self._engaged_ns = self._servo_ns = t_ns
        self._reached_ns: int | None = None
        """When the goal of this engagement was reached first."""
        self._mode_before = VehicleMode.OTHER
        self._armed = False
        self._confirmed = False
        self._may_be_confirmed = False
        """A spell of motion has lasted as long as the initial-response check must."""
        self._awaits_hold = False
        self._handed_over = False
        self._taken_over = False
        self._offboard_asked = self._hold_asked = False

    def check(
        self, t_ns: int, events: Sequence[Event], output: GateOutput, state: GateState
    ) -> None:
        """Judge one step of the gate by its inputs, its output and the state it is in now.

        Raises
        ------
        InvariantError
            If an invariant does not hold.
        """
        now_ns = max(t_ns, self._stepped_ns)
        self.oracle.on_event(now_ns, t_ns - self._stepped_ns, events)
        is_commanded = False
        for event in events:
            if isinstance(event, Heartbeat):
                self._armed = event.armed
            if isinstance(event, Heartbeat | CurrentMode):
                self._on_mode(event.mode, is_commanded)
            elif isinstance(event, OperatorCommand) and event.action is Action.ENGAGE:
                self._taken_over = False
                is_commanded = True
        at = self.state
        for change in output.transitions:
            self._check_transition(change, at, now_ns, events)
            at = change.target
        _demand(at is state, "I9", f"in {state}, but the log ends in {at}")
        self._check_request(output.mode_request, now_ns, state)
        self._check_setpoint(output.setpoint, now_ns, state)
        self._check_stream(output.setpoint, now_ns, state)
        self._on_goals(events, output, now_ns, state)
        self.state = state
        self._stepped_ns = now_ns

    def _on_mode(self, mode: VehicleMode, is_commanded: bool) -> None:
        """I5: find out whether somebody else has the vehicle now, and no operator gave it back."""
        if self.state is GateState.ABORT:
            is_ours = self._armed and mode is VehicleMode.OFFBOARD
            self._taken_over |= not is_ours and not is_commanded
        elif self.state not in ENGAGED or self._handed_over:
            return
        elif not self._armed:
            self._taken_over = True
        elif mode is VehicleMode.OFFBOARD:
            self._confirmed = True
        elif self._awaits_hold and mode is VehicleMode.HOLD:
            self._handed_over = True
        elif self._confirmed or mode is not self._mode_before:
            self._taken_over = True

    def _on_goals(
        self, events: Sequence[Event], output: GateOutput, now_ns: int, state: GateState
    ) -> None:
        """Expect reports about the goal that the operator changed to, and a new check for it."""
        commands = [e for e in events if isinstance(e, OperatorCommand)]
        goals = [c.argument for c in commands if c.action is Action.GOAL]
        is_accepted = bool(goals) and not output.refusal
        stood = self.state in (GateState.HOLD, GateState.DONE)  # nothing refuses a goal there
        was_reached = self._reached_ns is not None and state is GateState.HOLD
        if goals and was_reached and (is_accepted or stood):
            self._begin(now_ns)
        if is_accepted:
            self._may_be_confirmed = False
            self.oracle.look_for(goals[-1])
        elif goals and len(commands) > 1:  # which were refused cannot be told from outside
            self.oracle.look_for(None)

    def _check_transition(
        self, change: Transition, at: GateState, now_ns: int, events: Sequence[Event]
    ) -> None:
        """I9: in the log, with its time and cause; I6: only an operator leads on from an end."""
        _demand(change.source is at, "I9", f"{change} does not start in {at}")
        _demand(change.target in TRANSITIONS[at], "I9", f"{change} is not allowed")
        _demand(change.t_ns == now_ns, "I7", f"{change} is not of {now_ns}")
        _demand(bool(str(change.cause)), "I9", f"{change} has no cause")
        if change.target is GateState.READY:
            _demand(not self.oracle.is_offboard, "I6", "ready beside another commander")
        elif change.target is GateState.ENGAGE:
            self._check_engaging(now_ns)
        elif change.target is GateState.SERVO:
            self._servo_ns = now_ns
        elif change.target in (GateState.DONE, GateState.ABORT):
            self._hold_asked = False
            if change.target is GateState.DONE and self._reached_ns is None:
                self._reached_ns = now_ns
        elif change.target is GateState.PREFLIGHT and at in ENDED:
            commands = [
                e for e in events if isinstance(e, OperatorCommand) and e.action is Action.ENGAGE
            ]
            _demand(bool(commands), "I5", f"left {at} without an operator's order")

    def _check_engaging(self, now_ns: int) -> None:
        """I6, I8: only a flying vehicle, and only one that nobody else commands."""
        oracle = self.oracle
        _demand(oracle.armed and oracle.in_air, "I8", "engaged a vehicle that does not fly")
        if self.config.engage is Engage.PILOT:
            _demand(oracle.is_offboard, "I6", "engaged without the pilot's OFFBOARD")
        else:
            _demand(not oracle.is_offboard, "I6", "engaged beside another commander")
            _demand(oracle.is_alone, "I6", "engaged beside another service")
            _demand(oracle.objection(now_ns) is None, "I4", oracle.objection(now_ns))
        self._begin(now_ns)

    def _begin(self, now_ns: int) -> None:
        """Remember where and when an engagement begins."""
        oracle = self.oracle
        self._engaged_ns = now_ns
        self._mode_before = oracle.mode
        self._confirmed = oracle.is_offboard
        self._awaits_hold = self._handed_over = self._may_be_confirmed = False
        self._offboard_asked = False
        self._reached_ns = None
        oracle.engaged(now_ns)

    def _check_request(self, request: ModeRequest | None, now_ns: int, state: GateState) -> None:
        """I8: OFFBOARD once while engaging, Hold once at an end; there is no word for more."""
        if request is None:
            return
        oracle = self.oracle
        _demand(not self._taken_over, "I5", f"{request} asked for after a takeover")
        doubt = oracle.doubt_of_mode(now_ns)
        _demand(doubt is None, "I5", f"{request} asked for although {doubt}")
        if request is ModeRequest.OFFBOARD:
            _demand(state is GateState.ENGAGE, "I8", f"OFFBOARD asked for in {state}")
            _demand(self.config.engage is not Engage.PILOT, "I8", "OFFBOARD is the pilot's to ask")
            _demand(not self._offboard_asked, "I8", "OFFBOARD asked for twice")
            _demand(oracle.may_fly, "I8", "OFFBOARD asked for on the ground")
            self._offboard_asked = True
            return
        _demand(request is ModeRequest.HOLD, "I8", f"asked for {request!r}")
        is_handed_over = state is GateState.DONE and self.config.on_done is OnDone.HOLD
        _demand(is_handed_over or state is GateState.ABORT, "I8", f"Hold asked for in {state}")
        _demand(oracle.is_offboard, "I5", "Hold asked for outside OFFBOARD")
        _demand(not self._hold_asked, "I8", "Hold asked for twice")
        self._hold_asked = True
        self._awaits_hold = state is GateState.DONE

    def _check_setpoint(self, v: BodyVelocity | None, now_ns: int, state: GateState) -> None:
        """I1, I2, I4, I5: none after a takeover; one that is not zero only where all is well."""
        if v is None:
            return
        _demand(not self._taken_over, "I5", f"{v} sent after a takeover")
        if v != ZERO:
            _demand(v.is_finite(), "I1", v)
            _demand(self._may_move_in(state), "I2", f"{v} sent in {state}")
            self._check_speed(v, now_ns)
            self._check_slew(v, now_ns)
            self._check_reason_to_move(v, now_ns)
        self._last, self._sent_ns = v, now_ns

    def _may_move_in(self, state: GateState) -> bool:
        """Tell whether a setpoint that is not zero may be sent in a state (I2)."""
        holds_visually = self.config.on_done is OnDone.HOLD_VISUAL
        return state is GateState.SERVO or (state is GateState.DONE and holds_visually)

    def _check_speed(self, v: BodyVelocity, now_ns: int) -> None:
        """I1: within limits, and at reduced speed until a spell in SERVO has lasted long enough."""
        limits = self.config.velocity
        if now_ns - self._servo_ns >= self.config.timing.response_ns:
            self._may_be_confirmed = True
        most_m_s = math.inf if self._may_be_confirmed else self.config.reduced_speed_m_s
        length_m_s = math.hypot(v.forward_m_s, v.right_m_s, v.down_m_s)
        _demand(length_m_s <= most_m_s + _ROUNDING, "I1", f"not at reduced speed: {v}")
        _demand(v.horizontal_m_s <= limits.horizontal_m_s + _ROUNDING, "I1", f"too fast: {v}")
        _demand(abs(v.down_m_s) <= limits.vertical_m_s + _ROUNDING, "I1", f"too fast: {v}")
        _demand(abs(v.yaw_rad_s) <= limits.yaw_rad_s + _ROUNDING, "I1", f"too fast: {v}")

    def _check_slew(self, v: BodyVelocity, now_ns: int) -> None:
        """I1: no faster change of velocity than allowed."""
        _demand(self._sent_ns is not None, "I1", "the stream does not begin from zero")
        sent_ns = now_ns if self._sent_ns is None else self._sent_ns
        dt_s = min((now_ns - sent_ns) / S, _LONGEST_SLEW_S)
        is_slow = least_time_s(self._last, v, self.config.velocity) <= dt_s + _ROUNDING
        _demand(is_slow, "I1", f"from {self._last} to {v} within {dt_s} s")

    def _check_reason_to_move(self, v: BodyVelocity, now_ns: int) -> None:
        """I1, I4: bounded in distance and time, by a fresh good frame, with no fault known."""
        oracle, config = self.oracle, self.config
        if self._reached_ns is None:
            since_ns, most_ns = self._engaged_ns, config.max_engaged_ns
        else:
            since_ns, most_ns = self._reached_ns, config.hold_visual_ns
        _demand(now_ns - since_ns <= most_ns, "I1", "engaged too long")
        distance_m = oracle.distance_m
        _demand(distance_m <= config.max_distance_m, "I1", f"{distance_m} m from the start")
        was_moving = self._may_move_in(self.state)
        faults = oracle.faults if was_moving else []
        _demand(not faults, "I4", f"{v} sent although {faults}")
        is_wrong = was_moving and oracle.is_mounted_wrong
        _demand(not is_wrong, "I4", f"{v} sent although the camera is mounted another way")
        _demand(oracle.good_capture_ns is not None, "I4", f"{v} sent without a good frame")
        objection = oracle.objection(now_ns)
        _demand(objection is None, "I4", f"{v} sent although {objection}")

    def _check_stream(self, v: BodyVelocity | None, now_ns: int, state: GateState) -> None:
        """I3: while engaged every step sends, unless it comes right after one that did.

        Whoever steps at least every 135 ms therefore streams without a pause over 150 ms.
        """
        if v is not None or state not in ENGAGED or self._handed_over:
            return
        _demand(self._sent_ns is not None, "I3", f"nothing sent in {state}")
        gap_ns = now_ns - (self._sent_ns or 0)
        _demand(
            gap_ns < self.config.timing.setpoint_gap_ns, "I3", f"{gap_ns} ns of silence in {state}"
        )
