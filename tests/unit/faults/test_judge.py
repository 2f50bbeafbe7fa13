"""How a case is judged: by what was recorded since the fault."""

import dataclasses
import math
from types import SimpleNamespace

import numpy as np
import pytest

from dfvs_core.gate.states import GateState
from dfvs_robustness.faults.fault import NO_VERDICT, Case, Fault, Outcome, Reaction
from dfvs_robustness.faults.judging import Oracle, judge
from dfvs_robustness.faults.matrix import (
    append_result,
    plan,
    read_outcomes,
    shared_harness,
)
from dfvs_robustness.faults.report import Report, make_rows
from dfvs_robustness.faults.table import all_faults
from dfvs_robustness.faults.workers import Result

MS = 1_000_000
S = GateState
T0 = 1_000_000 * MS


def fault(reaction, limit_ms=300.0):
    return Fault("x", "x", "x", reaction, limit_ms, (S.SERVO,), lambda harness, rng: None)


def setpoints(moving_until_ms, silent_after_ms=1000):
    times = range(-100, silent_after_ms + 1, 20)
    return [
        {
            "t_ns": T0 + t * MS,
            "velocity": [0.1 if t <= moving_until_ms else 0.0, 0.0, 0.0],
            "yaw_rate_rad_s": 0.0,
        }
        for t in times
    ]


def to(state, at_ms):
    return {"t_ns": T0 + at_ms * MS, "target": str(state), "cause": "some cause", "detail": "why"}


def seen(state, moving_until_ms=200, transitions=(), **changes):
    values = {
        "setpoints": setpoints(moving_until_ms),
        "mode_commands": [],
        "transitions": list(transitions),
        "state": state,
        "is_running": True,
        "over_ns": T0 + 900 * MS,
    }
    return Oracle(**{**values, **changes})


HELD = [{"t_ns": T0 + 50 * MS, "mode": "HOLD"}]


def verdict(reaction, oracle, state=S.SERVO, limit_ms=300.0, says=()):
    case = dataclasses.replace(fault(reaction, limit_ms), says=says)
    return judge(case, state, 0, T0, oracle)


@pytest.mark.parametrize(
    ("reaction", "state", "target"),
    [
        (Reaction.HOLD, S.SERVO, S.HOLD),
        (Reaction.ABORT, S.HOLD, S.ABORT),
        (Reaction.RELEASED, S.SERVO, S.RELEASED),
        (Reaction.HOLD, S.READY, S.PREFLIGHT),
        (Reaction.ABORT, S.READY, S.PREFLIGHT),
    ],
)
def test_a_reaction_for_another_reason_than_the_fault_does_not_pass(reaction, state, target):
    silent = setpoints(-200, 20)
    oracle = seen(target, -200, [to(target, 10)], setpoints=silent)
    assert verdict(reaction, oracle, state, says=("not this", "why")).passed
    outcome = verdict(reaction, oracle, state, says=("not this",))
    assert (outcome.passed, outcome.problem) == (False, "the gate said 'some cause: why'")


@pytest.mark.parametrize(
    ("state", "after", "passes"),
    [
        (S.ENGAGE, S.ENGAGE, True),
        (S.ENGAGE, S.HOLD, True),
        (S.SERVO, S.HOLD, True),
        (S.HOLD, S.HOLD, True),
        (S.DONE, S.HOLD, True),
        (S.DONE, S.DONE, False),
        (S.HOLD, S.SERVO, False),
    ],
)
def test_what_must_hold_must_leave_what_moves_by_vision(state, after, passes):
    assert verdict(Reaction.HOLD, seen(after, -200), state).passed is passes


@pytest.mark.parametrize("state", [S.ABORT, S.RELEASED])
def test_what_the_autopilot_ends_as_well_may_end_either_way(state):
    says = ("some cause",)
    ended = seen(state, -200, [to(state, 10)], setpoints=setpoints(-200, 20))
    assert verdict(Reaction.ENDED, ended, says=says).passed
    assert not verdict(Reaction.ENDED, ended, says=("not this",)).passed
    assert not verdict(Reaction.ENDED, seen(S.SERVO, -200), says=says).passed
    asked = dataclasses.replace(ended, mode_commands=HELD)
    assert verdict(Reaction.ENDED, asked, says=says).passed is (state is S.ABORT)


def test_frames_that_grow_old_are_reason_enough_where_frames_are_at_fault():
    old = {**to(S.HOLD, 210), "cause": "last good frame too old"}
    assert verdict(Reaction.HOLD, seen(S.HOLD, 200, [old]), says=("black",)).passed
    ended = seen(S.ABORT, 100, [{**old, "target": "ABORT"}])
    assert not verdict(Reaction.ABORT, ended, says=("black",)).passed


def test_a_fault_that_lasts_must_lead_from_ready_back_to_preflight():
    stays = seen(S.READY, -200, must_leave=True)
    assert "went on to pass" in verdict(Reaction.HOLD, stays, S.READY).problem
    leaves = seen(S.PREFLIGHT, -200, [to(S.PREFLIGHT, 600)], must_leave=True)
    assert verdict(Reaction.HOLD, leaves, S.READY).passed
    assert verdict(Reaction.HOLD, seen(S.READY, -200), S.READY).passed


def test_hold_is_timed_to_the_first_zero():
    outcome = verdict(Reaction.HOLD, seen(S.HOLD, 200, [to(S.HOLD, 210)]))
    assert (outcome.passed, outcome.reaction_ms) == (True, 220.0)
    assert outcome.cause == "some cause: why"


@pytest.mark.parametrize(
    ("reaction", "oracle", "problem"),
    [
        (Reaction.HOLD, seen(S.HOLD, 300), "320 ms"),
        (Reaction.HOLD, seen(S.SERVO, -200), "SERVO"),
        (Reaction.ABORT, seen(S.HOLD, 100), "never went to ABORT"),
        (Reaction.ABORT, seen(S.ABORT, 100, [to(S.ABORT, 301)]), "301 ms"),
        (Reaction.RELEASED, seen(S.RELEASED, -200, [to(S.RELEASED, 1)]), "1000 ms"),
        (Reaction.SILENCE, seen(S.SERVO, is_running=False), "1000 ms"),
        (Reaction.SILENCE, seen(S.SERVO, setpoints=[]), "still runs"),
        (Reaction.EXIT, seen(S.ABORT), "still runs"),
        (Reaction.EXIT, seen(S.ABORT, is_running=False), "not given back to Hold"),
        (Reaction.EXIT, seen(S.ABORT, is_running=False, mode_commands=HELD), "900 ms"),
        (Reaction.STREAM, seen(S.SERVO, setpoints=[]), "no setpoints"),
        (Reaction.REFUSED, seen(S.ENGAGE), "ENGAGE"),
        (Reaction.IGNORED, seen(S.HOLD), "HOLD"),
    ],
)
def test_what_is_late_or_wrong_fails_and_says_why(reaction, oracle, problem):
    outcome = verdict(reaction, oracle)
    assert not outcome.passed
    assert problem in outcome.problem


def test_a_mode_command_after_a_takeover_fails():
    asked = [{"t_ns": T0 + MS, "mode": "HOLD"}]
    oracle = seen(S.RELEASED, setpoints=[], mode_commands=asked, transitions=[to(S.RELEASED, 1)])
    assert "asked for HOLD" in verdict(Reaction.RELEASED, oracle).problem


def test_ready_must_not_become_engaged():
    assert verdict(Reaction.ABORT, seen(S.PREFLIGHT, -200), S.READY).passed
    assert not verdict(Reaction.ABORT, seen(S.ENGAGE, -200), S.READY).passed


@pytest.mark.parametrize(
    ("reaction", "state"), [(Reaction.HOLD, S.HOLD), (Reaction.ABORT, S.ABORT)]
)
@pytest.mark.parametrize("last_ms", [180, -20])
def test_silence_while_the_vehicle_moves_is_no_zero(reaction, state, last_ms):
    oracle = seen(state, transitions=[to(state, 190)], setpoints=setpoints(last_ms, last_ms))
    assert "without a zero" in verdict(reaction, oracle, says=("why",)).problem
    assert "without a zero" in verdict(reaction, dataclasses.replace(oracle, setpoints=[])).problem


@pytest.mark.parametrize("state", [S.ENGAGE, S.HOLD])
def test_silence_where_zeros_were_sent_already_lets_nothing_move(state):
    oracle = seen(S.ABORT, transitions=[to(S.ABORT, 90)], setpoints=[])
    assert verdict(Reaction.ABORT, oracle, state).passed


def test_a_case_that_moves_on_the_way_must_end_with_a_zero():
    begun = [to(S.SERVO, -90), to(S.ABORT, 190)]
    moved = seen(S.ABORT, transitions=begun, setpoints=setpoints(180, 180))
    assert "without a zero" in verdict(Reaction.ABORT, moved, S.ENGAGE).problem


def test_the_cause_of_a_case_is_that_of_the_reaction():
    begun = {**to(S.SERVO, -90), "cause": "engaged"}
    outcome = verdict(Reaction.ABORT, seen(S.ABORT, transitions=[begun, to(S.ABORT, 1)]), S.ENGAGE)
    assert outcome.cause == "some cause: why"


@pytest.mark.parametrize("name", ["wrong-mount", "sideways-mount"])
@pytest.mark.parametrize(("speed_m_s", "t0_ms"), [(0.0, 40), (0.1, 30)])
def test_a_wrong_mounting_that_is_told_before_a_motion_is_found(name, speed_m_s, t0_ms):
    log = [to(S.ENGAGE, -1000), to(S.SERVO, 0), to(S.ABORT, 40)]
    pose = {"t_ns": T0 + 30 * MS, "kind": "pose", "velocity": (speed_m_s, 0.0, 0.0)}
    harness = SimpleNamespace(
        await_state=lambda *states: None,
        service=SimpleNamespace(
            log=SimpleNamespace(transitions=lambda since=0: [t for t in log if t["t_ns"] >= since])
        ),
        environment=SimpleNamespace(events=[pose]),
    )
    mounted = all_faults()[name]
    t0_ns = mounted.inject(harness, np.random.default_rng(0))
    assert t0_ns == T0 + t0_ms * MS
    cause = {**log[-1], "cause": mounted.says[0]}
    ended = seen(S.ABORT, 20, [*log[1:-1], cause])
    assert judge(mounted, *map(S, mounted.states), 0, t0_ns, ended).passed


def test_an_end_of_the_service_without_a_zero_fails():
    oracle = seen(S.ABORT, setpoints=setpoints(180, 180), is_running=False, mode_commands=HELD)
    assert "without a zero" in verdict(Reaction.EXIT, oracle, limit_ms=1000.0).problem


def test_a_vehicle_that_the_autopilot_takes_need_not_be_braked():
    oracle = seen(S.ABORT, transitions=[to(S.ABORT, 190)], setpoints=setpoints(180, 180))
    assert verdict(Reaction.ENDED, oracle).passed


def test_no_zero_can_arrive_over_a_link_that_is_cut():
    oracle = seen(S.ABORT, transitions=[to(S.ABORT, 190)], setpoints=setpoints(0, 0))
    cut = dataclasses.replace(fault(Reaction.ABORT), cuts_link=True)
    assert judge(cut, S.SERVO, 0, T0, oracle).passed


def test_the_silence_up_to_the_end_of_a_case_counts_as_a_gap():
    oracle = seen(S.SERVO, setpoints=setpoints(-200, 240))
    assert verdict(Reaction.STREAM, oracle, limit_ms=150.0).reaction_ms == 660.0


def test_the_stream_is_timed_by_its_longest_gap():
    oracle = seen(S.SERVO)
    assert verdict(Reaction.STREAM, oracle, limit_ms=20.0).passed
    del oracle.setpoints[10]
    assert verdict(Reaction.STREAM, oracle, limit_ms=30.0).reaction_ms == 40.0


def test_rows_count_seeds_and_name_what_failed():
    good = verdict(Reaction.HOLD, seen(S.HOLD, 200))
    bad = verdict(Reaction.HOLD, seen(S.HOLD, 400))
    (row,) = make_rows([good, bad], {"x": fault(Reaction.HOLD)})
    assert (row.seeds, row.passed, row.max_ms) == (2, 1, 420.0)
    assert row.problems == ("took 420 ms, 300 ms allowed",)


@pytest.mark.parametrize(("not_run", "passed"), [(0, True), (1, False)])
def test_a_report_passes_only_where_every_planned_case_was_run(not_run, passed):
    good = verdict(Reaction.HOLD, seen(S.HOLD, 200))
    report = Report(make_rows([good], {"x": fault(Reaction.HOLD)}), [], not_run)
    assert report.passed == passed
    assert ("1 of 1 cases passed, 1 not run" in report.verdict) == (not passed)


def test_the_plan_holds_every_fault_in_each_of_its_states_for_every_seed():
    faults = all_faults()
    cases = plan([], [], 3)
    assert len(cases) == 3 * sum(len(f.states) for f in faults.values())
    assert len(set(cases)) == len(cases)
    assert {c.state for c in plan(["takeover"], ["SERVO"], 1)} == {"SERVO"}


def test_every_case_has_one_life_with_others_of_its_setup_state_by_state():
    faults, states, cases = all_faults(), list(GateState), plan([], [], 5)
    groups = shared_harness(cases)
    assert sorted(map(str, (case for group in groups for case in group))) == sorted(map(str, cases))
    for group in groups:
        assert len({(faults[c.fault].setup, faults[c.fault].restarts) for c in group}) == 1
        order = [states.index(GateState(c.state)) for c in group]
        assert order == sorted(order)
    seeds = [min(c.seed for c in group) for group in groups]
    assert seeds == sorted(seeds)


def test_a_case_without_a_verdict_fails_until_a_later_run_gives_one(tmp_path):
    kept = tmp_path / "runs.jsonl"
    never = Outcome("black", "SERVO", 3, False, math.inf, "", f"{NO_VERDICT}: machine too busy", 3)
    append_result(kept, Result(never))
    append_result(kept, Result(violations=("I1: x",)))
    case = Case("black", "SERVO", 3)
    outcomes, violations = read_outcomes(kept)
    assert (outcomes[case].passed, outcomes[case].has_verdict) == (False, False)
    append_result(kept, Result(Outcome("black", "SERVO", 3, True, 90.0, "dark")))
    outcomes, violations = read_outcomes(kept)
    assert (outcomes[case].passed, outcomes[case].has_verdict) == (True, True)
    assert violations == ["I1: x"]
