import pytest

from dfvs_service.gate.failsafe import judge_failsafe


def test_the_advised_failsafe_passes_without_a_word():
    read = judge_failsafe(7, 0.5, 5)
    assert (read.t_ns, read.advice, read.refusals) == (7, (), ())
    assert read.found == "COM_OF_LOSS_T 0.5, COM_OBL_RC_ACT 5"


@pytest.mark.parametrize(
    ("loss_s", "action", "advice"),
    [(1.0, 5, "COM_OF_LOSS_T is 1; 0.5 is advised"), (0.5, 0, "COM_OBL_RC_ACT is 0 (position)")],
)
def test_what_is_merely_not_advised_is_said_and_refuses_nothing(loss_s, action, advice):
    read = judge_failsafe(0, loss_s, action)
    assert read.refusals == ()
    (line,) = read.advice
    assert line.startswith(advice)


@pytest.mark.parametrize(
    ("loss_s", "action", "refusal"),
    [
        (1.001, 5, "COM_OF_LOSS_T is 1.001 s"),
        (60.0, 5, "fly on blindly"),
        (0.0, 5, "COM_OF_LOSS_T is 0 s"),
        (float("nan"), 5, "COM_OF_LOSS_T is nan s"),
        (None, 5, "COM_OF_LOSS_T could not be read"),
        (0.5, None, "COM_OBL_RC_ACT could not be read"),
        (0.5, 6, "COM_OBL_RC_ACT is 6 (terminate)"),
        (0.5, 7, "COM_OBL_RC_ACT is 7 (disarm)"),
        (0.5, 99, "COM_OBL_RC_ACT is 99 (not known)"),
    ],
)
def test_what_is_dangerous_or_not_known_is_refused(loss_s, action, refusal):
    (line,) = judge_failsafe(0, loss_s, action).refusals
    assert refusal in line
