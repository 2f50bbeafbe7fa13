"""The invariants under garbage: random events, numbers that are none, and leaps in time."""

import dataclasses
import math

import numpy as np
import pytest
from gate_rehearsal import TICK_NS, Rehearsal
from hypothesis import given, settings
from hypothesis import strategies as st

from dfvs_core.gate.config import MS, Engage, GateConfig, GateTiming, OnDone, S
from dfvs_core.gate.events import (
    Action,
    Attitude,
    BadReport,
    Battery,
    EstimatorState,
    Health,
    Heartbeat,
    LandedState,
    LocalPosition,
    OperatorCommand,
    ParametersRead,
    Report,
    Stop,
    VehicleMode,
)
from dfvs_core.gate.states import ENGAGED, GateState
from dfvs_core.messages.link import PerceptionReport
from dfvs_robustness.fuzz.gate.invariants import InvariantChecker

anything = st.floats(allow_nan=True, allow_infinity=True)
number = st.one_of(st.floats(-2.0, 2.0), anything)
triple = st.tuples(number, number, number)
offset = st.one_of(st.integers(-400 * MS, 50 * MS), st.integers(-(10**19), 10**19))
configs = st.builds(
    GateConfig,
    engage=st.sampled_from(Engage),
    on_done=st.sampled_from(OnDone),
    max_engaged_ns=st.sampled_from([10 * S, 120 * S]),
    hold_visual_ns=st.sampled_from([2 * S, 300 * S]),
    timing=st.builds(GateTiming, response_ns=st.sampled_from([0, S])),
)


@st.composite
def reports(draw, t_ns):
    return PerceptionReport(
        seq=draw(st.integers(-5, 5)),
        t_capture_ns=t_ns + draw(offset),
        velocity=draw(st.tuples(number, number, number, number)),
        healthy=draw(st.booleans()),
        reached=draw(st.booleans()),
        lost=draw(st.booleans()) and draw(st.booleans()),
        reason="",
        error_m=draw(number),
        error_rad=draw(number),
        overlap=draw(number),
        feature_error=draw(st.none() | number),
        mounting_score=draw(st.none() | st.floats(-20.0, 20.0) | anything),
        goal=draw(st.sampled_from(["", "ab" * 32])),
        goals_left=draw(st.integers(0, 2)),
    )


def wild_events(now_ns):
    """Any event at all, with any stamp."""
    t_ns = offset.map(lambda shift_ns: now_ns + shift_ns)
    flag = st.booleans()
    return st.one_of(
        st.builds(Heartbeat, t_ns, st.sampled_from(VehicleMode), flag, flag),
        st.builds(Attitude, t_ns, number, number, number),
        st.builds(LocalPosition, t_ns, triple, triple),
        st.builds(LandedState, t_ns, flag, flag),
        st.builds(Battery, t_ns, st.none() | number),
        st.builds(Health, t_ns, flag),
        st.builds(EstimatorState, t_ns, flag),
        st.builds(ParametersRead, t_ns),
        st.builds(BadReport, t_ns, st.just("garbage")),
        st.builds(OperatorCommand, t_ns, st.sampled_from(Action), st.sampled_from(["", "ab" * 32])),
        st.builds(Stop, t_ns, st.just(""), flag),
        st.builds(Report, t_ns, reports(now_ns)),
    )


class Watched(Rehearsal):
    """A rehearsal whose every step is checked."""

    def __post_init__(self):
        super().__post_init__()
        self.invariants = InvariantChecker(self.config, self.now_ns)
        self.seen = set()

    def send(self, events):
        output = super().send(events)
        self.invariants.check(self.now_ns, events, output, self.state)
        self.seen.add(self.state)
        return output


@settings(max_examples=60)
@given(st.data())
def test_invariants_hold_whatever_comes_in(data):
    gate = Watched(data.draw(configs))
    if data.draw(st.booleans()):  # half of the examples begin in the middle of a flight
        try_to_fly(gate)
    for _ in range(data.draw(st.integers(1, 12))):
        leap = data.draw(st.one_of(st.just(TICK_NS), st.integers(-S, 3 * S)))
        gate.now_ns += leap
        gate.send(data.draw(st.lists(wild_events(gate.now_ns), max_size=4)))
        gate.run(data.draw(st.sampled_from([0.0, 0.1, 1.5])))


def try_to_fly(gate):
    """Let a nominal engagement begin in the configured way."""
    gate.run(2.5)
    if gate.config.engage is Engage.PILOT:
        gate.beat(mode=VehicleMode.OFFBOARD)
    gate.command(Action.ENGAGE)
    gate.run(2.5)


def pick(rng, choices):
    return choices[rng.integers(len(choices))]  # Generator.choice would turn an enum into text


def fly_again(gate):
    """Mend everything, bring the vehicle to Hold, and let a new engagement begin."""
    gate.vehicle = type(gate.vehicle)()
    gate.sees, gate.changes, gate.asked = True, {}, (0.3, 0.1, 0.0, 0.1)
    gate.follows_goal = True
    gate.latency_ns, gate.error_m = 40 * MS, 2.0
    gate.run(3.0)
    gate.command(Action.ENGAGE)
    try_to_fly(gate)


def mend(gate, rng):
    """Undo every disturbance but the mode that the vehicle is in."""
    old = gate.vehicle
    gate.vehicle = dataclasses.replace(type(old)(), mode=old.mode, position_m=old.position_m)
    gate.sees, gate.changes = True, {"reached": bool(rng.random() < 0.2)}
    gate.latency_ns, gate.follows_goal = 40 * MS, True


def change_vehicle(gate, rng):
    changes = [
        ("mode", pick(rng, list(VehicleMode))),
        ("armed", bool(rng.integers(2))),
        ("in_air", False),
        ("roll_rad", math.nan),
        ("battery", pick(rng, [None, 0.1, math.nan])),
        ("sends_heartbeat", False),
        ("sends_attitude", False),
        ("sends_position", False),
        ("obeys", False),
    ]
    name, value = pick(rng, changes)
    setattr(gate.vehicle, name, value)


def change_sight(gate, rng):
    changes = [
        ("sees", False),
        ("latency_ns", int(rng.integers(0, 400)) * MS),
        ("asked", tuple(rng.choice([0.0, 0.3, -5.0, math.nan, math.inf, 1e300], 4))),
        ("asked", tuple(rng.normal(0.0, 0.4, 4))),
        ("changes", {"healthy": False}),
        ("changes", {"mounting_score": float(rng.choice([-50.0, -6.0, 0.0, 50.0]))}),
        ("follows_goal", False),
    ]
    name, value = pick(rng, changes)
    setattr(gate, name, value)


def leap(gate, rng):
    gate.now_ns += int(rng.integers(-2 * S, 2 * S))


def order(gate, rng):
    action = pick(rng, list(Action))
    argument = pick(rng, ["ab" * 32, "cd" * 32]) if action is Action.GOAL else ""
    gate.command(action, argument)


def disturb(gate, rng):
    """Change one thing; half of the time mend everything instead."""
    kinds = [mend, mend, mend, mend, change_vehicle, change_sight, order, leap]
    pick(rng, kinds)(gate, rng)


def test_a_gate_that_never_engages_sends_nothing_whatever_comes_in():
    rng = np.random.default_rng(20)
    gate = Watched(GateConfig(engage=Engage.NEVER))
    for _ in range(300):
        if rng.random() < 0.1:
            fly_again(gate)
        disturb(gate, rng)
        gate.run(float(rng.choice([0.04, 0.2, 1.2])))
    assert {GateState.READY, GateState.ABORT} <= gate.seen
    assert not gate.setpoints
    assert not gate.requests


@pytest.mark.parametrize("engage", [Engage.PILOT, Engage.AUTO, Engage.COMMAND])
@pytest.mark.parametrize("on_done", list(OnDone))
def test_invariants_hold_in_a_long_disturbed_life(engage, on_done):
    rng = np.random.default_rng([20, list(Engage).index(engage), list(OnDone).index(on_done)])
    config = GateConfig(engage=engage, on_done=on_done, max_engaged_ns=30 * S)
    gate = Watched(config)
    for _ in range(300):
        if gate.state not in ENGAGED or rng.random() < 0.02:
            fly_again(gate)
        disturb(gate, rng)
        gate.run(float(rng.choice([0.04, 0.2, 1.2])))
    # The walk must have been everywhere, or it proves little.
    assert gate.seen == set(GateState)
