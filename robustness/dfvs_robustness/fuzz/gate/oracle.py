"""What a gate has been told, judged without the gate's own code.

The judgement is written a second time, from the specification, so that a mistake in the gate is
not repeated by whoever checks it.
"""

import math
from collections.abc import Sequence

from dfvs_core.gate.config import GateConfig, S
from dfvs_core.gate.events import (
    Action,
    Attitude,
    BadReport,
    Battery,
    CurrentMode,
    EstimatorState,
    Event,
    ForeignSetpoint,
    Health,
    Heartbeat,
    LandedState,
    LocalPosition,
    MonitorFailed,
    OperatorCommand,
    OtherServices,
    ParametersRead,
    Report,
    Stop,
    VehicleMode,
)
from dfvs_core.messages.link import PerceptionReport

_LONG_AGO = -(1 << 62)
_MOST_M_S = _MOST_RAD_S = 10.0
"""No servo law in its right mind asks for more."""

_CLEAR_SCORE = 5.0
"""Standard deviations from which on a wrong mounting ends a flight."""


class Oracle:
    """The newest word of each kind, and whether the data have been good since.

    Every stamp later than the present counts as the present.
    """

    def __init__(self, config: GateConfig) -> None:
        self._config = config
        self.mode = VehicleMode.OTHER
        self.armed = False
        self.in_air = False
        self.is_alone = True
        """No other service holds or awaits this vehicle."""
        self.start_m: tuple[float, ...] = (0.0, 0.0, 0.0)
        """Where the vehicle was when it was engaged."""
        self.good_capture_ns: int | None = None
        """Capture of the frame that may be flown by, None where there is none."""
        self.faults: list[str] = []
        """What went wrong in this very step."""
        self.goal: str | None = ""
        """Digest of the goal that reports must be about; None where any will do."""
        self.is_mounted_wrong = False
        """A good frame of this very step told of another mounting than the settings do."""
        self._newest_capture_ns = -1
        self._engaged_ns = _LONG_AGO
        self._heartbeat_ns = self._attitude_ns = self._position_ns = _LONG_AGO
        self._may_have_missed_mode = True
        """No word of the mode came since the link was silent."""
        self._resumed_ns = _LONG_AGO
        self._position_m: tuple[float, ...] = (0.0, 0.0, 0.0)
        self._velocity_m_s: tuple[float, ...] = (0.0, 0.0, 0.0)
        self._attitude_finite = self._position_finite = True
        self._failsafe = self._on_ground = False
        self._estimator_valid = False
        self._estimator_ns = self._health_ns = self._landed_ns = _LONG_AGO
        self._services_ns = self._parameters_ns = _LONG_AGO
        self._is_watched = True
        self._dangerous: tuple[str, ...] = ()
        """What the autopilot's parameters are refused for."""
        self._is_stopped = False
        self._battery: float | None = None
        self._other_commander = False

    def on_event(self, now_ns: int, pause_ns: int, events: Sequence[Event]) -> None:
        """Take the events of one step, which came ``pause_ns`` after the one before."""
        self.faults = []
        self.is_mounted_wrong = False
        if pause_ns > self._config.timing.stall_ns:
            self._invalidate("the gate was away")
        for event in events:
            self._on_event(event, min(event.t_ns, now_ns))
        good_ns = self.good_capture_ns
        if good_ns is not None and now_ns - good_ns > self._config.timing.frame_age_ns:
            self._invalidate("the last good frame is old")

    def _on_event(self, event: Event, t_ns: int) -> None:
        match event:
            case Report():
                self._on_report(event.report, t_ns)
            case LocalPosition():
                self._on_position(event, t_ns)
            case BadReport():
                self._invalidate("a report that is none")
            case Stop():
                self.faults.append("told to stop")
                self._is_stopped = True
            case OperatorCommand() if event.action in (Action.HOLD, Action.ABORT):
                self.faults.append(f"ordered to {event.action}")
            case ParametersRead():
                self._parameters_ns = t_ns
                self._dangerous = event.refusals
            case MonitorFailed():
                self._is_watched = False
            case _:
                self._on_vehicle(event, t_ns)

    def _on_vehicle(self, event: Event, t_ns: int) -> None:
        match event:
            case Heartbeat():
                self._heartbeat_ns = t_ns
                self._on_word_of_mode(t_ns)
                self.mode, self.armed = event.mode, event.armed
                self._failsafe = event.failsafe
            case CurrentMode() if self._heartbeat_ns != _LONG_AGO:
                self.mode = event.mode
                self._on_word_of_mode(t_ns)
            case Attitude():
                self._on_word_of_motion(t_ns)
                self._attitude_ns = t_ns
                self._attitude_finite = _finite(event.roll_rad, event.pitch_rad, event.yaw_rad)
            case LandedState():
                self._landed_ns = t_ns
                self.in_air, self._on_ground = event.in_air, event.on_ground
            case Health():
                self._health_ns = t_ns
            case Battery():
                self._battery = event.remaining
            case EstimatorState():
                self._estimator_ns, self._estimator_valid = t_ns, event.valid
            case OtherServices():
                self._services_ns = t_ns
                self._other_commander = bool(event.engaged)
                self.is_alone = not (event.engaged or event.standing_by)
            case ForeignSetpoint() if t_ns >= self._engaged_ns:
                self.faults.append("somebody else sent a setpoint")

    def _on_word_of_motion(self, t_ns: int) -> None:
        """Find out whether the link was silent until now: a word of the mode may be lost."""
        if self.silent_for_ns(t_ns) > self._config.timing.link_silent_ns:
            self._may_have_missed_mode = True
            self._resumed_ns = t_ns

    def _on_word_of_mode(self, t_ns: int) -> None:
        """Count on the mode again, unless the word may be older than what was missed."""
        is_new = t_ns > self._resumed_ns + self._config.timing.link_silent_ns
        self._may_have_missed_mode = not is_new

    def _on_position(self, event: LocalPosition, t_ns: int) -> None:
        self._on_word_of_motion(t_ns)
        if self._position_ns != _LONG_AGO:
            dt_s = max(t_ns - self._position_ns, 0) / S
            speed = max(math.hypot(*self._velocity_m_s), math.hypot(*event.velocity_m_s))
            leap = math.dist(self._position_m, event.position_m) - speed * dt_s
            if not leap <= self._config.max_jump_m:
                self.faults.append("the position estimate jumped")
        self._position_ns = t_ns
        self._position_m, self._velocity_m_s = event.position_m, event.velocity_m_s
        self._position_finite = _finite(*event.position_m, *event.velocity_m_s)

    def _on_report(self, report: PerceptionReport, t_ns: int) -> None:
        timing = self._config.timing
        age_ns = t_ns - report.t_capture_ns
        ours = self.goal is None or report.goal == self.goal
        is_future = age_ns < -timing.clock_skew_ns
        if report.lost or is_future or not (ours and report.healthy and _sane(report)):
            self._invalidate("a report that cannot be flown by")
        elif age_ns <= timing.result_age_ns and report.t_capture_ns > self._newest_capture_ns:
            self._newest_capture_ns = self.good_capture_ns = report.t_capture_ns
            score = report.mounting_score
            self.is_mounted_wrong = score is not None and score <= -_CLEAR_SCORE

    def _invalidate(self, fault: str) -> None:
        self.good_capture_ns = None
        self.faults.append(fault)

    def look_for(self, goal: str | None) -> None:
        """Count on reports about another goal alone from now on."""
        self.goal = goal
        self.good_capture_ns = None

    def engaged(self, now_ns: int) -> None:
        """Start the distance, the time and the search for other commanders here."""
        self.start_m = self._position_m
        self._engaged_ns = now_ns

    @property
    def is_offboard(self) -> bool:
        """Tell whether the last heartbeat showed OFFBOARD, armed."""
        return self.armed and self.mode is VehicleMode.OFFBOARD

    @property
    def may_fly(self) -> bool:
        """Tell whether the vehicle is armed and not known to stand on the ground."""
        return self.armed and not self._on_ground

    def doubt_of_mode(self, now_ns: int) -> str | None:
        """Say why the pilot may have changed the mode unheard, None where that is unlikely."""
        timing = self._config.timing
        if now_ns - self._heartbeat_ns > timing.mode_known_ns:
            return "the last heartbeat is old"
        if self.silent_for_ns(now_ns) > timing.link_silent_ns:
            return "the link is silent"
        if self._may_have_missed_mode:
            return "the link was silent since the last word of the mode"
        return None

    def silent_for_ns(self, now_ns: int) -> int:
        """Time since the last attitude or position, whichever came later."""
        return now_ns - max(self._attitude_ns, self._position_ns)

    def objection(self, now_ns: int) -> str | None:
        """Say why the vehicle must not be moved now, None where it may."""
        config, timing = self._config, self._config.timing
        if self._is_stopped:
            return "told to stop"
        if now_ns - self._heartbeat_ns > timing.heartbeat_age_ns:
            return "no heartbeat"
        if now_ns - min(self._attitude_ns, self._position_ns) > timing.telemetry_age_ns:
            return "no telemetry"
        if (
            now_ns - min(self._estimator_ns, self._health_ns, self._landed_ns)
            > timing.status_age_ns
        ):
            return "no word of estimator, sensors or landing"
        if not (self._attitude_finite and self._position_finite and self._estimator_valid):
            return "no valid estimate"
        if config.min_battery > 0 and not (self._battery or 0.0) >= config.min_battery:
            return "battery low or unknown"
        if self._failsafe:
            return "autopilot in failsafe"
        if self._on_ground:
            return "vehicle on the ground"
        if self._other_commander:
            return "another service is engaged"
        return self._watch_objection(now_ns)

    def _watch_objection(self, now_ns: int) -> str | None:
        """Say that parameters or other services are not watched, or parameters dangerous."""
        timing = self._config.timing
        if not self._is_watched or now_ns - self._services_ns > timing.services_age_ns:
            return "other services are not watched"
        if now_ns - self._parameters_ns > timing.parameters_age_ns:
            return "the failsafe parameters are not watched"
        if self._dangerous:
            return "the autopilot's parameters are dangerous"
        return None

    @property
    def distance_m(self) -> float:
        """Distance from where the vehicle was engaged."""
        return math.dist(self._position_m, self.start_m)


def _finite(*numbers: float) -> bool:
    return all(map(math.isfinite, numbers))


def _sane(report: PerceptionReport) -> bool:
    """Tell whether all numbers of a report are what such numbers can be."""
    forward, right, down, yaw = report.velocity
    return (
        _finite(forward, right, down, yaw, report.error_m, report.error_rad)
        and math.hypot(forward, right, down) <= _MOST_M_S
        and abs(yaw) <= _MOST_RAD_S
        and min(report.error_m, report.error_rad) >= 0.0
        and 0.0 <= report.overlap <= 1.0
        and (report.feature_error is None or 0.0 <= report.feature_error < math.inf)
        and (report.mounting_score is None or math.isfinite(report.mounting_score))
    )
