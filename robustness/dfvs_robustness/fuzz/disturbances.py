"""What may go wrong with a vehicle, a perception, an operator and a clock, one thing at a time."""

from __future__ import annotations

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
    OperatorCommand,
    OtherServices,
    ParametersRead,
    Report,
    Stop,
    VehicleMode,
    VelocityTarget,
    WatchEnded,
)
from dfvs_core.messages.link import PerceptionReport
from dfvs_robustness.fuzz.random_source import Dice

Triple = tuple[float, float, float]

MODES = tuple(VehicleMode)
GOALS = ("", "a" * 64, "b" * 64)
"""Digests of goals that an operator may change to."""

_ACTIONS = tuple(Action)
_ODD_NUMBERS = (math.nan, math.inf, -math.inf, 1e300, -5.0, 0.0, -0.0, 5e-324, 9.99, 1.0)
_ODD_SHIFTS_NS = (-(10**19), -S, -1, 0, 1, S, 10**19)


@dataclass(slots=True)
class World:
    """How everything around a gate behaves just now; fresh, it all is well."""

    mode: VehicleMode = VehicleMode.HOLD
    armed: bool = True
    failsafe: bool = False
    in_air: bool = True
    on_ground: bool = False
    battery: float | None = 0.9
    healthy: bool = True
    estimator_valid: bool = True
    position_m: Triple = (1.0, 2.0, -3.0)
    velocity_m_s: Triple = (0.0, 0.0, 0.0)
    roll_rad: float = 0.0
    yaw_rad: float = 0.0
    follows: float = 1.0
    """Share of a setpoint that the vehicle flies; negative where it goes the wrong way."""
    beats: bool = True
    tells_mode: bool = True
    """CURRENT_MODE after each change, as PX4 from 1.15 on does."""
    tells_attitude: bool = True
    tells_position: bool = True
    tells_status: bool = True
    obeys: bool = True
    sees: bool = True
    latency_ns: int = 40 * MS
    asked: tuple[float, float, float, float] = (0.3, -0.1, 0.05, 0.1)
    error_m: float = 1.0
    mounting_score: float | None = 3.0
    falls: bool = True
    reached: bool = False
    lost: bool = False
    report_healthy: bool = True
    overlap: float = 0.8
    others: tuple[tuple[str, ...], tuple[str, ...]] = ((), ())
    """Other services for this vehicle: those that stand by, those that are engaged."""
    foreign_m_s: float = 0.0
    """Velocity that somebody else adds to the gate's."""
    tick_ns: int = 60 * MS


def calm(world: World, dice: Dice) -> World:
    """Return a world in which all is well again; mode and place stay what they are."""
    return World(
        mode=world.mode,
        tells_mode=dice.chance(0.7),
        position_m=world.position_m if _is_finite(world.position_m) else (1.0, 2.0, -3.0),
        yaw_rad=world.yaw_rad if math.isfinite(world.yaw_rad) else 0.0,
        reached=dice.chance(0.3),
        tick_ns=dice.pick((20, 45, 60, 90, 120)) * MS,
        asked=_velocity(dice),
    )


def disturbed(world: World, dice: Dice) -> World:
    """Return a world in which one more thing is wrong, until it is calmed."""
    kind = dice.pick((_vehicle, _vehicle, _sight, _sight, _numbers, _telemetry, _rivals))
    return kind(world, dice)


def _vehicle(world: World, dice: Dice) -> World:
    changes = (
        {"mode": dice.pick(MODES)},
        {"mode": VehicleMode.OFFBOARD},
        {"armed": dice.chance(0.5)},
        {"in_air": False, "on_ground": dice.chance(0.5)},
        {"battery": dice.pick((None, 0.1, 0.2, math.nan))},
        {"failsafe": True},
        {"obeys": False},
    )
    return replace(world, **dice.pick(changes))  # type: ignore[arg-type]


def _sight(world: World, dice: Dice) -> World:
    changes = (
        {"sees": False},
        {"latency_ns": dice.integer(-30, 400) * MS},
        {"latency_ns": dice.integer(190, 260) * MS},
        {"report_healthy": False},
        {"lost": True},
        {"falls": False, "error_m": 5.0},
        {"overlap": dice.between(0.0, 0.2)},
        {"reached": not world.reached},
        {"error_m": dice.pick(_ODD_NUMBERS)},
        {"mounting_score": dice.pick((None, 50.0, 6.0, -5.0, -50.0, *_ODD_NUMBERS))},
    )
    return replace(world, **dice.pick(changes))  # type: ignore[arg-type]


def _numbers(world: World, dice: Dice) -> World:
    if dice.chance(0.3):
        return replace(world, asked=_velocity(dice))
    asked = list(world.asked)
    asked[dice.integer(0, 3)] = dice.pick(_ODD_NUMBERS)
    return replace(world, asked=(asked[0], asked[1], asked[2], asked[3]))


def _telemetry(world: World, dice: Dice) -> World:
    north, east, down = world.position_m
    changes = (
        {"beats": False},
        {"tells_mode": False},
        {"tells_attitude": False},
        {"tells_position": False},
        {"tells_status": False},
        {"roll_rad": math.nan},
        {"estimator_valid": False},
        {"healthy": False},
        {"yaw_rad": dice.pick((math.nan, 3.0, -3.1, 0.0))},
        {"follows": math.nan},
        {"position_m": (north + dice.between(-3.0, 3.0), east, down)},
        {"follows": dice.pick((0.0, 0.3, -1.0, 3.0))},
        {"tick_ns": dice.pick((1, 150, 151, 400)) * MS},
    )
    return replace(world, **dice.pick(changes))  # type: ignore[arg-type]


def _rivals(world: World, dice: Dice) -> World:
    changes = (
        {"others": (("another",), ())},
        {"others": ((), ("another",))},
        {"foreign_m_s": dice.pick((0.3, -1.0, math.nan))},
    )
    return replace(world, **dice.pick(changes))  # type: ignore[arg-type]


def _velocity(dice: Dice) -> tuple[float, float, float, float]:
    scale = dice.pick((0.02, 0.2, 1.0))
    return (
        dice.between(-scale, scale),
        dice.between(-scale, scale),
        dice.between(-scale, scale),
        dice.between(-scale, scale),
    )


def _is_finite(triple: Triple) -> bool:
    return all(map(math.isfinite, triple))


def odd_event(now_ns: int, dice: Dice) -> Event:
    """Any event at all, with any stamp and any numbers."""
    t_ns = now_ns + (
        dice.integer(-400 * MS, 50 * MS) if dice.chance(0.7) else dice.pick(_ODD_SHIFTS_NS)
    )
    return dice.pick(_ODD_EVENTS)(t_ns, dice)


def _landed_state(t_ns: int, dice: Dice) -> LandedState:
    flies = dice.chance(0.7)
    return LandedState(t_ns, flies, not flies and dice.chance(0.5))


def _stop(t_ns: int, dice: Dice) -> Event:
    """Seldom: nothing moves any more in a life that was told to stop."""
    if dice.chance(0.8):
        return BadReport(t_ns, "garbage")
    return Stop(t_ns, "told to", dice.chance(0.5))


_ODD_EVENTS: tuple[Callable[[int, Dice], Event], ...] = (
    lambda t, dice: Heartbeat(t, dice.pick(MODES), dice.chance(0.8), dice.chance(0.1)),
    lambda t, dice: CurrentMode(t, dice.pick(MODES)),
    lambda t, dice: Attitude(t, *_triple(dice)),
    lambda t, dice: LocalPosition(t, _triple(dice), _triple(dice)),
    _landed_state,
    lambda t, dice: Battery(t, None if dice.chance(0.2) else _number(dice)),
    lambda t, dice: Health(t, dice.chance(0.7), can_arm=dice.chance(0.7)),
    lambda t, dice: EstimatorState(t, dice.chance(0.7)),
    lambda t, dice: ParametersRead(t),
    lambda t, dice: BadReport(t, "garbage"),
    lambda t, dice: OperatorCommand(t, dice.pick(_ACTIONS), dice.pick(GOALS)),
    lambda t, dice: VelocityTarget(t, _triple(dice)),
    lambda t, dice: ForeignSetpoint(t, "from elsewhere"),
    lambda t, dice: OtherServices(t, *dice.pick(((), (("another",),), ((), ("another",))))),
    lambda t, dice: WatchEnded(t, "failed") if dice.chance(0.1) else ParametersRead(t),
    _stop,
    lambda t, dice: Report(t, odd_report(t, dice)),
)


def odd_report(t_ns: int, dice: Dice) -> PerceptionReport:
    """Return a report with any numbers."""
    return PerceptionReport(
        seq=dice.integer(-5, 5),
        t_capture_ns=t_ns + dice.pick((-(10**19), -S, -250 * MS, -40 * MS, -1, 0, 6 * MS, 10**19)),
        velocity=(_number(dice), _number(dice), _number(dice), _number(dice)),
        healthy=dice.chance(0.8),
        reached=dice.chance(0.3),
        lost=dice.chance(0.1),
        reason="",
        error_m=_number(dice),
        error_rad=_number(dice),
        overlap=_number(dice),
        feature_error=None if dice.chance(0.5) else _number(dice),
        mounting_score=None if dice.chance(0.5) else 10.0 * _number(dice),
    )


def _number(dice: Dice) -> float:
    return dice.between(-0.5, 1.5) if dice.chance(0.9) else dice.pick(_ODD_NUMBERS)


def _triple(dice: Dice) -> Triple:
    return _number(dice), _number(dice), _number(dice)
