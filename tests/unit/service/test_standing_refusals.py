from dfvs_core.gate.checks.preflight import Check
from dfvs_service.supervisor.heartbeat import Heartbeat
from dfvs_service.supervisor.refusals import StandingRefusals

S = 1_000_000_000
LATE = Check("frames", False, "no frame for 0.50 s", "check the camera")
FAR = Check("frames", False, "the goal is not in view", "check the camera")


def told(*times, state="PREFLIGHT"):
    """Lines told, with their times, of one state after the other: (time in s, check)."""
    refusals = StandingRefusals()
    beats = [Heartbeat(round(t * S), state, "", checks=() if c is None else (c,)) for t, c in times]
    lines = [(beat.t_ns / S, refusals.update(beat)) for beat in beats]
    return [(t, line) for t, line in lines if line]


def standing(check, start, end):
    return [(t / 5, check) for t in range(5 * start, 5 * end)]


def test_a_check_that_refuses_for_3_s_is_told_once_with_its_remedy():
    line = "not ready: frames: the goal is not in view (check the camera)"
    assert told(*standing(FAR, 100, 200)) == [(103.0, line)]


def test_another_reason_is_told_and_another_number_is_not():
    later = Check("frames", False, "no frame for 10.00 s", LATE.remedy)
    reasons = [*standing(LATE, 0, 10), *standing(later, 10, 20), *standing(FAR, 20, 30)]
    assert [t for t, _ in told(*reasons)] == [3.0, 23.0]


def test_of_reasons_that_keep_changing_one_is_told_every_30_s():
    checks = [Check("frames", False, "no frame" + "!" * k) for k in range(3)]
    changing = [(t / 5, checks[t % 3]) for t in range(700)]
    assert [int(t) // 30 for t, _ in told(*changing)] == [1, 2, 3]


def test_a_check_that_comes_and_goes_is_told_once_and_again_after_30_s_without_it():
    flapping = [(t / 5, (LATE, None)[t // 25 % 2]) for t in range(1000)]
    later = standing(None, 200, 231) + standing(LATE, 231, 240)
    assert [t for t, _ in told(*flapping, *later)] == [3.0, 231.0]


def test_passing_checks_advice_and_other_states_are_not_told():
    advice = Check("hold", False, "no position", binding=False)
    assert told(*standing(None, 0, 50)) == told(*standing(advice, 0, 50)) == []
    assert told(*standing(FAR, 0, 50), state="READY") == []
