"""State of the gate, its transitions with their entry actions, and the setpoint of each state."""

import math

from dfvs_core.gate.checks.initial_response import InitialResponse
from dfvs_core.gate.checks.perception_monitor import PerceptionMonitor
from dfvs_core.gate.checks.preflight import Check, preflight, sole_commander
from dfvs_core.gate.config import Engage, GateConfig, OnDone, S
from dfvs_core.gate.engagement import begin
from dfvs_core.gate.events import ModeRequest
from dfvs_core.gate.flight import holds_visually
from dfvs_core.gate.limits import BodyVelocity
from dfvs_core.gate.states import ENDED, Cause, GateState, Transition
from dfvs_core.gate.stream import SetpointStream
from dfvs_core.gate.vehicle import Fault, VehicleMonitor
from dfvs_core.messages.link import PerceptionReport


class TransitionState:
    """State of the gate: state machine state, vehicle, perception, engagement, setpoint stream.

    Parameters
    ----------
    config : GateConfig
        Limits, times, and how to engage and end.
    t_ns : int
        Monotonic time of the start.
    """

    def __init__(self, config: GateConfig, t_ns: int) -> None:
        self.config = config
        self.state = GateState.IDLE
        self.reason = ""
        """Why the machine is in this state; in PREFLIGHT, or for a command, what is missing."""
        self.has_reached = False
        """The goal was reached in the last engagement; not any more once there is another."""
        self.vehicle = VehicleMonitor(config.timing)
        self.perception = PerceptionMonitor(config.timing)
        self.stream = SetpointStream(config)
        self._engagement = begin(self.vehicle, t_ns)
        self._engagement.start_m = (math.nan, math.nan, math.nan)  # of no engagement yet
        self._now = t_ns
        self._since = t_ns
        self._passing_since: int | None = None
        self._failing_since: int | None = None
        self._commanded_ns: int | None = None
        self._is_hold_requested = False
        self._is_stopped = False
        self._transitions: list[Transition] = []
        self._request: ModeRequest | None = None
        self._refusal = ""

    @property
    def is_finished(self) -> bool:
        """Whether the flight is over: only an operator's command can lead on from here."""
        return self.stream.is_silent and self.state in ENDED

    @property
    def since_ns(self) -> int:
        """Monotonic time at which the present state was entered."""
        return self._since

    @property
    def distance_m(self) -> float:
        """Distance from where the gate was engaged last, NaN before it ever was."""
        return math.dist(self.vehicle.position.position_m, self._engagement.start_m)

    def checks(self) -> tuple[Check, ...]:
        """Preflight list of this moment."""
        listed = preflight(self.vehicle, self.perception, self.config, self._now)
        awaits_pilot = self.state is GateState.READY and self.config.engage is Engage.PILOT
        sole = sole_commander(self.vehicle, self._now, may_be_offboard=awaits_pilot)
        return (*listed, sole)

    def _elapsed(self, t_ns: int) -> int:
        return self._now - t_ns

    def _is_commanded(self) -> bool:
        valid_ns = self.config.timing.command_valid_ns
        return self._commanded_ns is not None and self._elapsed(self._commanded_ns) <= valid_ns

    def _ready_reason(self, problem: str) -> str:
        """Say what a command to engage waits for, or that it has expired."""
        if self.config.engage is not Engage.COMMAND or self._commanded_ns is None:
            return str(Cause.CHECKS_PASSED)
        where = "Hold or Position in the air"
        if not self._is_commanded():
            valid_s = self.config.timing.command_valid_ns / S
            return f"engage has expired after {valid_s:g} s, command it again in {where}"
        if problem:
            return f"engage waits for {problem}"
        flies = "flying" if self.vehicle.is_flying else "not flying"
        mode = self.vehicle.heartbeat.mode
        return f"engage waits for {where}; the vehicle is in {mode}, {flies}"

    def _hold_servo(self, cause: Fault) -> None:
        if self._is_moving:
            self._go(GateState.HOLD, cause)

    @property
    def _holds_visually(self) -> bool:
        return self.state is GateState.DONE and holds_visually(self._engagement)

    @property
    def _is_moving(self) -> bool:
        """Whether setpoints other than zero may be sent in this state."""
        return self.state is GateState.SERVO or self._holds_visually

    def _abort(self, cause: Fault) -> None:
        if self.state not in (GateState.ABORT, GateState.RELEASED):
            self._go(GateState.ABORT, cause)

    def _go(self, target: GateState, cause: Fault) -> None:
        """Change the state and log why."""
        record = Transition(self._now, self.state, target, cause[0], cause[1])
        self._transitions.append(record)
        self._enter(target)
        self.state = target
        self.reason = record.reason
        self._since = self._now
        self._passing_since = None
        self._failing_since = None

    def _enter(self, target: GateState) -> None:
        """What entering a state brings with it."""
        if target is GateState.READY:
            self.stream.is_silent = self.config.engage is not Engage.PILOT
        elif target is GateState.ENGAGE:
            self._engagement = begin(self.vehicle, self._now)
            self.vehicle.other_commanders.forget_targets()
            self.stream.is_silent = False
            self.has_reached = False
        elif target is GateState.SERVO:
            self._check_response()
        elif target is GateState.HOLD and self.state is GateState.DONE:
            self._engagement.response = None
        elif target is GateState.DONE:
            self._enter_done()
        elif target is GateState.ABORT:
            self._is_hold_requested = False
        elif target is GateState.RELEASED:
            self.stream.silence()

    def _enter_done(self) -> None:
        self.has_reached = True
        if self.config.on_done is OnDone.HOLD_VISUAL and self._engagement.reached_ns is None:
            self._engagement.reached_ns = self._now

    def _check_response(self) -> None:
        """Begin the initial-response check, or go on with the one that a HOLD interrupted."""
        engagement = self._engagement
        if self.config.timing.response_ns <= 0 or engagement.is_confirmed_response:
            engagement.response = None
        elif engagement.response is None:
            engagement.response = InitialResponse(self._now)
        else:
            engagement.response.resume(self._now)

    def _update_response(self, response: InitialResponse, report: PerceptionReport) -> None:
        """Take a good report into the initial-response check; the route may have gone on by it."""
        if report.goals_left != response.goals_left:
            response.change_goal(report.goals_left, self._now)
        if self._is_moving:
            response.update(report)

    def _next_setpoint(self) -> BodyVelocity | None:
        if not self._is_moving:
            setpoint = self.stream.zero(self._now)
        else:
            response = self._engagement.response
            if response is not None:
                velocity_m_s = self.vehicle.position.velocity_m_s
                yaw_rad = self.vehicle.attitude.yaw_rad
                response.integrate(self.stream.last, velocity_m_s, yaw_rad, self._now)
            wanted = self.perception.velocity()
            setpoint = self.stream.move(wanted, self._now, is_reduced=response is not None)
        if setpoint is not None:
            self.vehicle.other_commanders.sent(setpoint, self._now)
        return setpoint
