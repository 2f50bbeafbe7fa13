"""Episode of a gate: random configuration, and an environment that helps it or disturbs it."""

import dataclasses
import math
from dataclasses import dataclass, field

import numpy as np

from dfvs_core.gate.config import MS, Engage, GateConfig, GateTiming, OnDone, S
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
    VelocityTarget,
)
from dfvs_core.gate.limits import VelocityLimits
from dfvs_core.gate.states import ENDED, GateState
from dfvs_core.messages.link import PerceptionReport
from dfvs_robustness.fuzz.gate.disturbances import GOALS, Environment, calm, disturbed, odd_event
from dfvs_robustness.fuzz.random_source import RandomSource

Step = tuple[int, tuple[Event, ...]]
"""Monotonic time in ns and the events of one call of the gate."""


@dataclass(frozen=True, slots=True)
class Episode:
    """Everything that a gate was told: enough to run it again."""

    config: GateConfig
    born_ns: int
    steps: list[Step] = field(default_factory=list)


_FLYING = tuple(e for e in Engage if e is not Engage.NEVER)


def draw_config(rng: RandomSource) -> GateConfig:
    """Draw a configuration; half of them with short times, so that more happens in an episode."""
    speed = rng.pick((0.25, 1.0, 1.0))
    config = GateConfig(
        velocity=VelocityLimits(rng.between(0.1, 1.0), rng.between(0.1, 0.6)),
        reduced_speed_m_s=rng.pick((0.02, 0.1, 0.5)),
        max_distance_m=rng.pick((0.5, 5.0, 5.0)),
        max_engaged_ns=rng.pick((4, 30, 120)) * S,
        hold_visual_ns=rng.pick((2, 10, 300)) * S,
        min_battery=rng.pick((0.0, 0.2, 0.2)),
        # "never" only checks and moves nothing: seldom drawn, so that most episodes fly
        engage=Engage.NEVER if rng.chance(0.05) else rng.pick(_FLYING),
        on_done=rng.pick(tuple(OnDone)),
    )
    if rng.chance(0.5):
        return config
    usual = config.timing
    timing = dataclasses.replace(
        GateTiming(),
        ready_after_ns=int(usual.ready_after_ns * speed),
        engage_zero_ns=int(usual.engage_zero_ns * speed),
        good_data_ns=int(usual.good_data_ns * speed),
        reached_ns=int(usual.reached_ns * speed),
        hold_ns=int(usual.hold_ns * speed),
        response_ns=rng.pick((0, int(usual.response_ns * speed))),
        response_limit_ns=int(usual.response_limit_ns * speed),
    )
    return dataclasses.replace(config, timing=timing)


class Surroundings:
    """Makes the events of an episode, step by step, and reacts to what the gate does.

    ``config`` tells how the gate is engaged, ``rng`` draws all that is random, and ``t_ns`` is the
    monotonic time of the start.
    """

    def __init__(self, config: GateConfig, rng: RandomSource, t_ns: int) -> None:
        self._config = config
        holds_visually = config.on_done is OnDone.HOLD_VISUAL
        self._ended = ENDED - {GateState.DONE} if holds_visually else ENDED
        self._rng = rng
        self._now_ns = t_ns
        self._environment = calm(Environment(), rng)
        self._heartbeat_ns = self._capture_ns = self._slow_ns = t_ns - 10 * S
        self._seq = 0
        self._flown_m_s = (0.0, 0.0, 0.0)
        self._sent_mode = VehicleMode.OTHER
        self._wanted_goal = self._seen_goal = ""
        self._commanded_goal: str | None = None

    def next(self, state: GateState) -> Step:
        """Time and events of the next step of a gate that is in this state."""
        rng, environment = self._rng, self._environment
        self._advance()
        if rng.chance(0.02):
            environment = disturbed(environment, rng)
        elif rng.chance(0.06 if environment.sends_status else 0.01):  # two seconds count there
            environment = calm(environment, rng)
        self._environment = environment
        self._people(state)
        events = self._nominal(state)
        if rng.chance(0.01):
            events.append(odd_event(self._now_ns, rng))
        if rng.chance(0.05):
            self._shuffle(events)
        goals = [
            e.argument for e in events if isinstance(e, OperatorCommand) and e.action is Action.GOAL
        ]
        self._commanded_goal = goals[-1] if goals else None
        return self._now_ns, tuple(events)

    def on_output(self, output: GateOutput) -> None:
        """Let the vehicle follow a mode request and fly what was set, and perception a new goal."""
        environment = self._environment
        if output.mode_request is not None and environment.obeys and self._rng.chance(0.9):
            hold = output.mode_request is ModeRequest.HOLD
            environment.mode = VehicleMode.HOLD if hold else VehicleMode.OFFBOARD
        if self._commanded_goal is not None and not output.refusal:
            self._wanted_goal = self._commanded_goal
        if (v := output.setpoint) is None:
            return
        if environment.falls and environment.error_m > 0.0:
            environment.error_m *= 0.97
        k, dt_s = environment.follows, environment.tick_ns / S
        c, s = math.cos(environment.yaw_rad), math.sin(environment.yaw_rad)
        north, east = c * v.forward_m_s - s * v.right_m_s, s * v.forward_m_s + c * v.right_m_s
        self._flown_m_s = (north + environment.foreign_m_s, east, v.down_m_s)
        environment.velocity_m_s = (k * north, k * east, k * v.down_m_s)
        x, y, z = (
            p + u * dt_s
            for p, u in zip(environment.position_m, environment.velocity_m_s, strict=True)
        )
        environment.position_m = (x, y, z)
        environment.yaw_rad += k * v.yaw_rad_s * dt_s

    def _advance(self) -> None:
        rng = self._rng
        self._now_ns += self._environment.tick_ns
        if rng.chance(0.005):
            leaps_ns = (-S, -MS, 0, 149 * MS, 151 * MS, S, 3 * S, 10 * S)
            self._now_ns += rng.pick(leaps_ns) + rng.integer(-MS, MS)

    def _people(self, state: GateState) -> None:
        """Let the pilot bring the vehicle to where the gate may be engaged."""
        rng, environment = self._rng, self._environment
        offboard = environment.mode is VehicleMode.OFFBOARD
        if state is GateState.READY and self._config.engage is Engage.PILOT and rng.chance(0.3):
            environment.mode = VehicleMode.OFFBOARD
        elif state in self._ended and rng.chance(0.2):
            environment.mode = VehicleMode.HOLD
        elif state is GateState.PREFLIGHT and rng.chance(0.1):
            environment.armed, environment.in_air, environment.on_ground = True, True, False
            if offboard:
                environment.mode = VehicleMode.HOLD

    def _nominal(self, state: GateState) -> list[Event]:
        """Everything that arrives in one step."""
        environment, now = self._environment, self._now_ns
        events: list[Event] = []
        if environment.sees:
            events.append(Report(now, self._report()))
        if environment.sends_attitude:
            events.append(Attitude(now, environment.roll_rad, 0.0, environment.yaw_rad))
        if environment.sends_position:
            events.append(LocalPosition(now, environment.position_m, environment.velocity_m_s))
        if environment.sends_heartbeat and now - self._heartbeat_ns >= 300 * MS:
            self._heartbeat_ns = now
            events.append(Heartbeat(now, environment.mode, environment.armed, environment.failsafe))
        if (
            environment.sends_mode
            and environment.mode is not self._sent_mode
            and self._rng.chance(0.7)
        ):
            self._sent_mode = environment.mode
            events.append(CurrentMode(now, environment.mode))
        if environment.mode is VehicleMode.OFFBOARD and self._rng.chance(0.3):
            events.append(VelocityTarget(now, self._flown_m_s))
        if environment.sends_status and now - self._slow_ns >= 700 * MS:
            self._slow_ns = now
            events += self._slow(now)
        if self._rng.chance(0.15 if state in {*self._ended, GateState.READY} else 0.01):
            events.append(self._operator_command(now))
        return events

    def _slow(self, now: int) -> list[Event]:
        environment = self._environment
        return [
            LandedState(now, environment.in_air, environment.on_ground),
            Battery(now, environment.battery),
            Health(now, environment.healthy, only_estimate=environment.only_estimate),
            EstimatorState(now, environment.estimator_valid),
            ParametersRead(now),
            OtherServices(now, *environment.others),
        ]

    def _operator_command(self, now: int) -> OperatorCommand:
        rng = self._rng
        if rng.chance(0.9):
            return OperatorCommand(now, Action.ENGAGE)
        return OperatorCommand(now, rng.pick(tuple(Action)), rng.pick(GOALS))

    def _report(self) -> PerceptionReport:
        environment, rng = self._environment, self._rng
        self._seq += 1
        if rng.chance(0.2):  # perception takes its time to look for another goal
            self._seen_goal = self._wanted_goal
        if not rng.chance(0.03):  # else the capture of the report before, once more
            self._capture_ns = self._now_ns - environment.latency_ns
        # clearly wrong now and then: a camera that is so from the start is never flown
        score = -50.0 if rng.chance(0.005) else environment.mounting_score
        return PerceptionReport(
            self._seq,
            self._capture_ns,
            environment.asked,
            environment.report_healthy,
            environment.reached,
            environment.lost,
            "",
            environment.error_m,
            0.1,
            environment.overlap,
            environment.error_m,
            score,
            goal=self._seen_goal,
            goals_left=environment.goals_left,
        )

    def _shuffle(self, events: list[Event]) -> None:
        """Let events arrive in another order, or one of them not at all."""
        if len(events) > 1:
            i = self._rng.integer(0, len(events) - 1)
            moved = events.pop(i)
            if self._rng.chance(0.5):
                events.insert(0, moved)


def begin_episode(generator: np.random.Generator) -> tuple[Episode, Surroundings]:
    """Return an empty episode with a drawn configuration, and what will surround it."""
    rng = RandomSource(generator)
    config = draw_config(rng)
    born_ns = rng.integer(0, 10**15)
    return Episode(config, born_ns), Surroundings(config, rng, born_ns)
