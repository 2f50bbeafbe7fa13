"""The gate under random inputs, and a checker that notices a gate that is broken."""

import dataclasses
import json
import math
from pathlib import Path

import pytest
from subcommand import run_subcommand

from dfvs_core.gate import flight, stream, transitions
from dfvs_core.gate.checks import perception_monitor
from dfvs_core.gate.checks.initial_response import InitialResponse, Response
from dfvs_core.gate.checks.perception_monitor import PerceptionMonitor
from dfvs_core.gate.checks.preflight import Check
from dfvs_core.gate.config import MS, GateConfig, S
from dfvs_core.gate.engagement import Engagement
from dfvs_core.gate.events import Attitude, GateOutput, ModeRequest
from dfvs_core.gate.limits import BodyVelocity
from dfvs_core.gate.machine import GateMachine
from dfvs_core.gate.states import Cause, GateState
from dfvs_core.gate.stream import SetpointStream
from dfvs_core.gate.vehicle import VehicleMonitor
from dfvs_robustness.commands import fuzz
from dfvs_robustness.fuzz.finding import Finding, InvariantError
from dfvs_robustness.fuzz.gate.episode import Episode
from dfvs_robustness.fuzz.gate.invariants import InvariantChecker
from dfvs_robustness.fuzz.gate.target import GATE, GateTally, replay_episode, run_episode
from dfvs_robustness.fuzz.run import run_job, shrink_list

DATA = Path(__file__).parents[2] / "data"


def run(*words):
    return run_subcommand(fuzz, "gate", *words)


def test_a_hundred_thousand_events_violate_nothing_and_reach_every_state(tmp_path, capsys):
    path = tmp_path / "figures.json"
    assert run("--events", 100_000, "--seed", 7, "--json", path) == 0
    figures = json.loads(path.read_text())
    assert figures["events"] >= 100_000
    assert figures["violations"] == []
    assert figures["episodes"] > figures["episodes_run_twice"] > 0
    flying = {"ENGAGE", "SERVO", "HOLD", "DONE", "ABORT", "RELEASED"}
    # A walk that hardly ever flies would prove little.
    assert all(figures["steps_by_state"][state] > 200 for state in flying)
    assert figures["steps_that_move"] > 3000
    assert len(figures["transitions"]) >= 20
    assert "0 violations" in capsys.readouterr().out


# --- a broken gate is noticed -------------------------------------------------------------


def forever(value):
    return lambda *args, **kwargs: value


def sends_faster(old):
    return lambda self, *args, **kwargs: (
        None if (v := old(self, *args, **kwargs)) is None else dataclasses.replace(v, down_m_s=0.9)
    )


def keeps_moving(self, now_ns):
    return None if self.is_silent else BodyVelocity(0.1)


def pauses(old):
    return lambda self, now_ns: old(self, now_ns) if now_ns % S < 600 * MS else None


def asks_again(old):
    def step(self, t_ns, events=()):
        output = old(self, t_ns, events)
        again = self.state is GateState.ABORT and self.vehicle.is_offboard
        return dataclasses.replace(output, mode_request=ModeRequest.HOLD) if again else output

    return step


def looks_at_the_hour(old):
    def step(self, t_ns, events=()):
        output = old(self, t_ns, events)
        odd = t_ns // S % 2 and output.mode_request is ModeRequest.OFFBOARD
        return dataclasses.replace(output, mode_request=None) if odd else output

    return step


def forgets_to_log(old):
    return lambda *args: dataclasses.replace(old(*args), transitions=())


def limits_each_axis_alone(old):
    def saturate(velocity, limits, most_m_s):
        vertical = min(limits.vertical_m_s, most_m_s)
        horizontal = min(limits.horizontal_m_s, most_m_s)
        return old(
            velocity, dataclasses.replace(limits, horizontal_m_s=horizontal, vertical_m_s=vertical)
        )

    return saturate


def caps_the_flight_alone(old):
    return lambda engagement, *args: (
        None if engagement.reached_ns is not None else old(engagement, *args)
    )


def moves_at_the_goal(self):
    return self.state in (GateState.SERVO, GateState.DONE)


def holds_in_servo_alone(old):
    return lambda self, cause: old(self, cause) if self.state is GateState.SERVO else None


def takes_reports_about_any_goal(old):
    return lambda self, report, t_ns: old(self, dataclasses.replace(report, goal=self.goal), t_ns)


def forgets_old_status(old):
    def flight_fault(*args):
        fault = old(*args)
        names = ("estimator's flags", "sensors", "landed state")
        return None if fault is not None and fault[1].startswith(names) else fault

    return flight_fault


def leaves_an_end_by_itself(old):
    def judge(self):
        if self.state is GateState.RELEASED:
            self._go(GateState.PREFLIGHT, (Cause.OPERATOR_AGAIN, ""))
        old(self)

    return judge


BROKEN = [
    ("I1", stream, "saturate", lambda old: lambda velocity, limits, most_m_s: velocity),
    ("I1", stream, "saturate", limits_each_axis_alone),
    ("I1", stream, "slew", lambda old: lambda last, target, dt_s, limits: target),
    ("I1", SetpointStream, "move", sends_faster),
    ("I1", flight, "cap", lambda old: forever(None)),
    ("I1", flight, "cap", caps_the_flight_alone),
    ("I1", InitialResponse, "evaluate", lambda old: forever(Response.CONFIRMED)),
    ("I2", SetpointStream, "zero", lambda old: keeps_moving),
    ("I2", GateMachine, "_is_moving", lambda old: property(moves_at_the_goal)),
    ("I3", SetpointStream, "zero", pauses),
    ("I4", PerceptionMonitor, "stale", lambda old: forever(None)),
    ("I4", flight, "flight_fault", lambda old: forever(None)),
    ("I4", flight, "flight_fault", forgets_old_status),
    ("I4", flight, "_unwatched", lambda old: forever(None)),
    ("I4", flight, "parameters_fault", lambda old: forever(None)),
    ("I4", GateMachine, "_invalidate_perception", lambda old: forever(None)),
    ("I4", GateMachine, "_hold_servo", lambda old: forever(None)),
    ("I4", GateMachine, "_hold_servo", holds_in_servo_alone),
    ("I4", PerceptionMonitor, "update", takes_reports_about_any_goal),
    ("I4", perception_monitor, "is_late", lambda old: forever(False)),
    ("I4", PerceptionMonitor, "mounting_fault", lambda old: forever(None)),
    ("I5", Engagement, "on_heartbeat", lambda old: forever(None)),
    ("I5", VehicleMonitor, "is_mode_known", lambda old: forever(True)),
    ("I5", VehicleMonitor, "_on_telemetry", lambda old: forever(None)),
    ("I5", GateMachine, "_evaluate", leaves_an_end_by_itself),
    ("I6", transitions, "sole_commander", lambda old: forever(Check("sole commander", True))),
    ("I7", GateMachine, "step", looks_at_the_hour),
    ("I8", GateMachine, "step", asks_again),
    ("I9", GateMachine, "step", forgets_to_log),
]


@pytest.mark.parametrize(("rule", "owner", "name", "breaking"), BROKEN)
def test_a_broken_gate_is_found_out(rule, owner, name, breaking, monkeypatch):
    monkeypatch.setattr(owner, name, breaking(getattr(owner, name)))
    rules = set()
    # Every twentieth is run twice, as I7 needs it.
    for number in range(0, 800, 20) if rule == "I7" else range(1, 61):
        finding = run_episode((0, number), GateTally())
        rules.add(finding and finding.rule)
        if rule in rules:
            return
    pytest.fail(f"{rule} was not found violated, only {rules}")


# --- violations are kept ------------------------------------------------------------------


@pytest.fixture
def finding(monkeypatch):
    """A violation of a gate that is broken for the whole test."""
    monkeypatch.setattr(Engagement, "on_heartbeat", forever(None))
    found = (run_episode((0, number), GateTally()) for number in range(40))
    return GATE.shrink(next(f for f in found if f is not None and f.rule == "I5"))


def test_a_violation_is_shrunk_to_what_it_needs(finding):
    assert len(finding.episode.steps) <= 60
    assert replay_episode(finding.episode).rule == "I5"
    for i in range(len(finding.episode.steps)):
        steps = finding.episode.steps[:i] + finding.episode.steps[i + 1 :]
        violation = replay_episode(dataclasses.replace(finding.episode, steps=steps))
        assert violation is None or violation.rule != "I5"


def test_a_saved_violation_is_violated_again_until_the_gate_is_mended(
    finding, tmp_path, capsys, monkeypatch
):
    path = tmp_path / "finding.json"
    GATE.write(finding, path)
    assert run("--replay", path) == 1
    assert "violated: I5" in capsys.readouterr().out
    monkeypatch.undo()
    assert run("--replay", path) == 0


def test_a_violation_saved_with_former_names_is_still_violated(monkeypatch):
    path = DATA / "gate_finding_former_names.json"
    assert '"event": "Order"' in path.read_text()
    episode = GATE.read(path)
    assert episode.config.timing.command_valid_ns == 4 * S
    assert replay_episode(episode) is None
    monkeypatch.setattr(Engagement, "on_heartbeat", forever(None))
    assert replay_episode(episode).rule == "I5"


def test_numbers_that_are_none_survive_the_file(tmp_path):
    steps = [(5, (Attitude(3, math.nan, math.inf, -math.inf),)), (6, ())]
    GATE.write(Finding(Episode(GateConfig(), 4, steps), "I1", ""), tmp_path / "f.json")
    episode = GATE.read(tmp_path / "f.json")
    assert (episode.config, episode.born_ns) == (GateConfig(), 4)
    assert repr(episode.steps) == repr(steps)  # NaN does not equal itself


def test_lists_are_shrunk_to_what_still_fails():
    assert shrink_list(list(range(100)), lambda some: {13, 77} <= set(some)) == [13, 77]


def test_an_episode_is_the_same_in_every_process():
    one, two = GateTally(), GateTally()
    run_episode((3, 11), one)
    two.add(run_job(GATE, 3, range(11, 12)).tally)
    assert one == two


def test_the_checker_demands_a_log_of_every_change():
    checker = InvariantChecker(GateConfig(), 0)
    with pytest.raises(InvariantError, match="I9"):
        checker.check(1, [], GateOutput(), GateState.PREFLIGHT)
