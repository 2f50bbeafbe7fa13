"""Answers to commands: what is tried, what passes, and the table about it."""

import dataclasses
import json

import pytest

from dfvs_core.gate.events import Action
from dfvs_core.gate.states import GateState
from dfvs_robustness.answers.measurement import (
    AnswerTimes,
    StateRate,
    Try,
    answer_problem,
    planned_actions,
)
from dfvs_robustness.answers.report import html_section, markdown_lines, read_answers
from dfvs_robustness.faults.report import Report

RATE = StateRate(60.0, 10.0, 120.0, 400.0, 1.0)


def times(answer_ms=5.0, problem="", rate=RATE):
    tries = [Try("SERVO", "hold", True, 5.0) for _ in range(197)]
    tries += [Try("HOLD", "abort", False, answer_ms, problem) for _ in range(3)]
    return AnswerTimes(tuple(tries), rate, 2, 2)


@pytest.mark.parametrize("state", GateState)
def test_hold_and_abort_are_both_tried_in_every_state(state):
    actions = planned_actions(state, 23)
    assert len(actions) == 23
    assert set(actions) == {Action.HOLD, Action.ABORT}


@pytest.mark.parametrize(
    ("action", "states", "answer", "is_true"),
    [
        (Action.HOLD, (GateState.SERVO, GateState.HOLD), "accepted: hold", True),
        (Action.HOLD, (GateState.READY, GateState.READY), "rejected: nothing is flown yet", True),
        (Action.HOLD, (GateState.READY, GateState.READY), "accepted: hold", False),
        (Action.HOLD, (GateState.SERVO, GateState.HOLD), "rejected: nothing is flown yet", False),
        (Action.HOLD, (GateState.HOLD, GateState.ABORT), "rejected: ended already", True),
        (Action.ABORT, (GateState.READY, GateState.ABORT), "accepted: abort", True),
        (Action.ABORT, (GateState.READY, GateState.ABORT), "rejected: ended already", False),
        (Action.HOLD, (GateState.SERVO, GateState.HOLD), "accepted: abort", False),
    ],
)
def test_an_answer_is_judged_by_the_state_in_which_the_command_arrives(
    action, states, answer, is_true
):
    assert (answer_problem(action, states, [answer]) == "") is is_true


@pytest.mark.parametrize(
    ("measured", "passed"),
    [
        (times(), True),
        (times(answer_ms=501.0), False),
        (times(problem="2 answers"), False),
        (times(rate=dataclasses.replace(RATE, rate_hz=8.9)), False),
        (times(rate=dataclasses.replace(RATE, largest_gap_ms=301.0)), False),
    ],
    ids=["all well", "late", "twice", "seldom", "gap"],
)
def test_what_is_answered_in_time_once_and_truly_passes(measured, passed):
    assert measured.passed is passed


def test_one_late_answer_in_two_hundred_is_within_99_of_100():
    late = Try("HOLD", "abort", False, 900.0)
    measured = times()
    assert dataclasses.replace(measured, tries=(*measured.tries[:-1], late)).passed


def test_the_table_counts_by_state_and_names_what_went_wrong():
    document = dataclasses.asdict(times(answer_ms=7.0, problem="2 answers"))
    text = "\n".join(markdown_lines(document))
    assert "| SERVO | in view | 197 | 0 | 197/197 | 5 | 5 | 5 |" in text
    assert "| HOLD | out of view | 0 | 3 | 0/3 | 7 | 7 | 7 |" in text
    assert "| all |  | 197 | 3 | 197/200 |" in text
    assert "- abort in HOLD: 2 answers" in text
    assert "<td>197/200</td>" in html_section(document)


def test_the_report_of_the_matrix_holds_it_where_it_is_given():
    document = dataclasses.asdict(times())
    for make in (Report.markdown, Report.html):
        assert "Answers to commands" in make(Report([], [], 0, answers=document))
        assert "Answers to commands" not in make(Report([], [], 0))


def test_results_are_read_back(tmp_path):
    document = dataclasses.asdict(times())
    path = tmp_path / "answers.json"
    path.write_text(json.dumps(document))
    assert markdown_lines(read_answers(path)) == markdown_lines(document)
