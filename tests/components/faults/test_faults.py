"""A small part of the fault matrix, with the real service."""

import json
import time

import pytest

from dfvs_core.gate.states import GateState
from dfvs_robustness.answers.measurement import run_answers
from dfvs_robustness.cli import main
from dfvs_robustness.faults.fault import Case
from dfvs_robustness.faults.matrix import run_matrix

pytestmark = pytest.mark.serial

CASES = (
    ("black", "SERVO"),
    ("camera-stops", "SERVO"),
    ("network-nan", "SERVO"),
    ("takeover", "SERVO"),
    ("estimator-invalid", "SERVO"),
    ("second-service", "HOLD"),
    ("foreign-setpoint", "ENGAGE"),
    ("gate-hangs", "SERVO"),
)


@pytest.mark.timeout(280)
def test_the_service_survives_a_sample_of_the_matrix():
    results = []
    cases = [Case(fault, state, seed=0) for fault, state in CASES]
    run_matrix(cases, 3, time.monotonic() + 240.0, results.append)
    outcomes = [r.outcome for r in results if r.outcome is not None]
    assert sorted((o.fault, o.state) for o in outcomes) == sorted(CASES)
    assert [o for o in outcomes if not o.passed] == []
    assert [text for r in results for text in r.violations] == []
    assert all(o.reaction_ms > 0 for o in outcomes if o.fault == "estimator-invalid")


def test_a_matrix_without_time_for_its_cases_does_not_pass(tmp_path, capsys):
    words = ["faults", "--only", "takeover", "--state", "SERVO", "--minutes", "0"]
    assert main([*words, "--json", str(tmp_path / "faults.json")]) == 1
    assert "0 of 0 cases passed, 1 not run" in capsys.readouterr().out
    assert json.loads((tmp_path / "faults.json").read_text())["not_run"] == 1


@pytest.mark.timeout(280)
def test_commands_are_answered_in_every_state_with_busy_cores(tmp_path):
    measured = run_answers(tmp_path, 1, 5.0, lambda _: None)
    assert [t.state for t in measured.tries] == [state.value for state in GateState]
    assert [t for t in measured.tries if t.problem] == []
    assert measured.passed
    assert measured.rate.searched > 0.5  # a handful of frames, of which one may match by chance


@pytest.mark.parametrize("words", [["--only", "no-such"], ["--seeds", "0"], ["--state", "FLYING"]])
def test_a_matrix_that_cannot_be_is_said_in_one_line(words, refused):
    refused(main, "faults", *words)
