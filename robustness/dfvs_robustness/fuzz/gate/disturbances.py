"""What may go wrong with a vehicle, a perception, an operator and a clock, one thing at a time."""

import math
from collections.abc import Callable
from dataclasses import dataclass, replace

from dfvs_core.gate.config import MS, S
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
    VelocityTarget,
)
from dfvs_core.messages.link import PerceptionReport
from dfvs_robustness.fuzz.random_source import RandomSource

Triple = tuple[float, float, float]

MODES = tuple(VehicleMode)
GOALS = ("", "a" * 64, "b" * 64)
"""Digests of goals that an operator may change to."""

_ACTIONS = tuple(Action)
_ODD_NUMBERS = (math.nan, math.inf, -math.inf, 1e300, -5.0, 0.0, -0.0, 5e-324, 9.99, 1.0)
_ODD_SHIFTS_NS = (-(10**19), -S, -1, 0, 1, S, 10**19)


@dataclass(slots=True)
class Environment:
    """How everything around a gate behaves just now; fresh, it all is well."""

    mode: VehicleMode = VehicleMode.HOLD
    armed: bool = True
    failsafe: bool = False
    in_air: bool = True
    on_ground: bool = False
    battery: float | None = 0.9
    healthy: bool = True
    only_estimate: bool = False
    """What is not healthy is the estimate alone."""
    estimator_valid: bool = True
    position_m: Triple = (1.0, 2.0, -3.0)
    velocity_m_s: Triple = (0.0, 0.0, 0.0)
    roll_rad: float = 0.0
    yaw_rad: float = 0.0
    follows: float = 1.0
    """Share of a setpoint that the vehicle flies; negative where it goes the wrong way."""
    sends_heartbeat: bool = True
    sends_mode: bool = True
    """CURRENT_MODE after each change, as PX4 from 1.15 on does."""
    sends_attitude: bool = True
    sends_position: bool = True
    sends_status: bool = True
    obeys: bool = True
    sees: bool = True
    latency_ns: int = 40 * MS
    asked: tuple[float, float, float, float] = (0.3, -0.1, 0.05, 0.1)
    error_m: float = 1.0
    mounting_score: float | None = 3.0
    falls: bool = True
    reached: bool = False
    goals_left: int = 0
    lost: bool = False
    report_healthy: bool = True
    overlap: float = 0.8
    others: tuple[tuple[str, ...], tuple[str, ...]] = ((), ())
    """Other services for this vehicle: those that stand by, those that are engaged."""
    foreign_m_s: float = 0.0
    """Velocity that somebody else adds to the gate's."""
    tick_ns: int = 60 * MS


def calm(environment: Environment, rng: RandomSource) -> Environment:
    """Return an environment in which all is well again; mode and place stay what they are."""
    position_m = environment.position_m
    return Environment(
        mode=environment.mode,
        sends_mode=rng.chance(0.7),
        position_m=position_m if all(map(math.isfinite, position_m)) else (1.0, 2.0, -3.0),
        yaw_rad=environment.yaw_rad if math.isfinite(environment.yaw_rad) else 0.0,
        reached=rng.chance(0.3),
        tick_ns=rng.pick((20, 45, 60, 90, 120)) * MS,
        asked=_velocity(rng),
    )


def disturbed(environment: Environment, rng: RandomSource) -> Environment:
    """Return an environment in which one more thing is wrong, until it is calmed."""
    kind = rng.pick((_vehicle, _vehicle, _sight, _sight, _numbers, _telemetry, _other_commanders))
    return kind(environment, rng)


def _vehicle(environment: Environment, rng: RandomSource) -> Environment:
    changes = (
        {"mode": rng.pick(MODES)},
        {"mode": VehicleMode.OFFBOARD},
        {"armed": rng.chance(0.5)},
        {"in_air": False, "on_ground": rng.chance(0.5)},
        {"battery": rng.pick((None, 0.1, 0.2, math.nan))},
        {"failsafe": True},
        {"obeys": False},
    )
    return replace(environment, **rng.pick(changes))  # type: ignore[arg-type]


def _sight(environment: Environment, rng: RandomSource) -> Environment:
    changes = (
        {"sees": False},
        {"latency_ns": rng.integer(-30, 400) * MS},
        {"latency_ns": rng.integer(190, 260) * MS},
        {"report_healthy": False},
        {"lost": True},
        {"falls": False, "error_m": 5.0},
        {"overlap": rng.between(0.0, 0.2)},
        {"reached": not environment.reached},
        {"goals_left": rng.integer(0, 2)},
        {"error_m": rng.pick(_ODD_NUMBERS)},
        {"mounting_score": rng.pick((None, 50.0, 6.0, -5.0, -50.0, *_ODD_NUMBERS))},
    )
    return replace(environment, **rng.pick(changes))  # type: ignore[arg-type]


def _numbers(environment: Environment, rng: RandomSource) -> Environment:
    if rng.chance(0.3):
        return replace(environment, asked=_velocity(rng))
    asked = list(environment.asked)
    asked[rng.integer(0, 3)] = rng.pick(_ODD_NUMBERS)
    return replace(environment, asked=(asked[0], asked[1], asked[2], asked[3]))


def _telemetry(environment: Environment, rng: RandomSource) -> Environment:
    north, east, down = environment.position_m
    changes = (
        {"sends_heartbeat": False},
        {"sends_mode": False},
        {"sends_attitude": False},
        {"sends_position": False},
        {"sends_status": False},
        {"roll_rad": math.nan},
        {"estimator_valid": False},
        {"healthy": False, "only_estimate": True},
        {"yaw_rad": rng.pick((math.nan, 3.0, -3.1, 0.0))},
        {"follows": math.nan},
        {"position_m": (north + rng.between(-3.0, 3.0), east, down)},
        {"follows": rng.pick((0.0, 0.3, -1.0, 3.0))},
        {"tick_ns": rng.pick((1, 150, 151, 400)) * MS},
    )
    return replace(environment, **rng.pick(changes))  # type: ignore[arg-type]


def _other_commanders(environment: Environment, rng: RandomSource) -> Environment:
    changes = (
        {"others": (("another",), ())},
        {"others": ((), ("another",))},
        {"foreign_m_s": rng.pick((0.3, -1.0, math.nan))},
    )
    return replace(environment, **rng.pick(changes))  # type: ignore[arg-type]


def _velocity(rng: RandomSource) -> tuple[float, float, float, float]:
    scale = rng.pick((0.02, 0.2, 1.0))
    return (
        rng.between(-scale, scale),
        rng.between(-scale, scale),
        rng.between(-scale, scale),
        rng.between(-scale, scale),
    )


def odd_event(now_ns: int, rng: RandomSource) -> Event:
    """Any event at all, with any stamp and any numbers."""
    t_ns = now_ns + (
        rng.integer(-400 * MS, 50 * MS) if rng.chance(0.7) else rng.pick(_ODD_SHIFTS_NS)
    )
    return rng.pick(_ODD_EVENTS)(t_ns, rng)


def _landed_state(t_ns: int, rng: RandomSource) -> LandedState:
    flies = rng.chance(0.7)
    return LandedState(t_ns, flies, not flies and rng.chance(0.5))


def _health(t_ns: int, rng: RandomSource) -> Event:
    ok, can_arm = rng.chance(0.7), rng.chance(0.7)
    return Health(t_ns, ok, can_arm=can_arm, only_estimate=can_arm and not ok)


def _stop(t_ns: int, rng: RandomSource) -> Event:
    """Seldom: nothing moves any more in an episode that was told to stop."""
    if rng.chance(0.8):
        return BadReport(t_ns, "garbage")
    return Stop(t_ns, "told to", rng.chance(0.5))


def _dangerous(t_ns: int) -> ParametersRead:
    return ParametersRead(t_ns, refusals=("the vehicle would fall",))


_ODD_EVENTS: tuple[Callable[[int, RandomSource], Event], ...] = (
    lambda t, rng: Heartbeat(t, rng.pick(MODES), rng.chance(0.8), rng.chance(0.1)),
    lambda t, rng: CurrentMode(t, rng.pick(MODES)),
    lambda t, rng: Attitude(t, *_triple(rng)),
    lambda t, rng: LocalPosition(t, _triple(rng), _triple(rng)),
    _landed_state,
    lambda t, rng: Battery(t, None if rng.chance(0.2) else _number(rng)),
    _health,
    lambda t, rng: EstimatorState(t, rng.chance(0.7)),
    lambda t, rng: ParametersRead(t),
    lambda t, rng: BadReport(t, "garbage"),
    lambda t, rng: OperatorCommand(t, rng.pick(_ACTIONS), rng.pick(GOALS)),
    lambda t, rng: VelocityTarget(t, _triple(rng)),
    lambda t, rng: ForeignSetpoint(t, "from elsewhere"),
    lambda t, rng: OtherServices(t, *rng.pick(((), (("another",),), ((), ("another",))))),
    lambda t, rng: MonitorFailed(t, "failed") if rng.chance(0.1) else _dangerous(t),
    _stop,
    lambda t, rng: Report(t, odd_report(t, rng)),
)


def odd_report(t_ns: int, rng: RandomSource) -> PerceptionReport:
    """Return a report with any numbers."""
    return PerceptionReport(
        seq=rng.integer(-5, 5),
        t_capture_ns=t_ns + rng.pick((-(10**19), -S, -250 * MS, -40 * MS, -1, 0, 6 * MS, 10**19)),
        velocity=(_number(rng), _number(rng), _number(rng), _number(rng)),
        healthy=rng.chance(0.8),
        reached=rng.chance(0.3),
        lost=rng.chance(0.1),
        reason="",
        error_m=_number(rng),
        error_rad=_number(rng),
        overlap=_number(rng),
        feature_error=None if rng.chance(0.5) else _number(rng),
        mounting_score=None if rng.chance(0.5) else 10.0 * _number(rng),
    )


def _number(rng: RandomSource) -> float:
    return rng.between(-0.5, 1.5) if rng.chance(0.9) else rng.pick(_ODD_NUMBERS)


def _triple(rng: RandomSource) -> Triple:
    return _number(rng), _number(rng), _number(rng)
