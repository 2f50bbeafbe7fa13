"""A worker of the fault matrix that dies costs the case that it is at, and nothing else."""

import os
import signal
import struct
import time

import pytest

from dfvs_robustness.faults.fault import Case, Outcome
from dfvs_robustness.faults.workers import Result, run_groups

GROUPS = [[Case("killed", "SERVO", seed) for seed in range(3)], [Case("black", "HOLD", 0)]]


def die(_results):
    os.kill(os.getpid(), signal.SIGKILL)


def die_while_it_writes(results):
    os.write(results.fileno(), struct.pack("!i", 1000) + b"the beginning")
    die(results)


def crash(_results):
    raise RuntimeError


def work(group, until, results, end):
    """Reports every case but the second one of the first group, in which it ends."""
    for case in group:
        if case == GROUPS[0][1]:
            end(results)
        results.send(Result(Outcome(case.fault, case.state, case.seed, True, 9.0, "")))


def work_until_killed(group, until, results):
    work(group, until, results, die)


def work_until_killed_while_it_writes(group, until, results):
    work(group, until, results, die_while_it_writes)


def work_until_it_crashes(group, until, results):
    work(group, until, results, crash)


def die_after_the_last_case(group, until, results):
    work(group[:1], until, results, die)
    if group == GROUPS[1]:
        die(results)


def outcomes(work, until=None, groups=GROUPS):
    """Outcomes by case, the last one of each."""
    taken = []
    until = time.monotonic() + 60.0 if until is None else until
    run_groups(groups, 2, until, taken.append, work)
    return {(r.outcome.fault, r.outcome.seed): r.outcome for r in taken}


@pytest.mark.parametrize(
    ("work", "said"),
    [
        (work_until_killed, "was killed by SIGKILL"),
        (work_until_killed_while_it_writes, "was killed by SIGKILL"),
        (work_until_it_crashes, "ended with code 1"),
    ],
)
def test_the_case_fails_without_a_verdict_and_all_others_are_run(work, said):
    found = outcomes(work)
    assert set(found) == {("killed", 0), ("killed", 1), ("killed", 2), ("black", 0)}
    assert [case for case, outcome in found.items() if not outcome.passed] == [("killed", 1)]
    lost = found["killed", 1]
    assert not lost.has_verdict
    assert f"worker died, it {said}" in lost.problem


def test_a_worker_that_dies_before_its_last_run_is_judged_fails_its_last_case():
    found = outcomes(die_after_the_last_case)
    assert found["killed", 0].passed
    assert not found["black", 0].passed


def test_no_case_is_begun_once_the_time_is_up():
    assert outcomes(work_until_killed, until=time.monotonic()) == {}
