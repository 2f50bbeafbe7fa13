"""Openings and turns come on two keys; each turn must meet the opening that it follows from."""

from dfvs_core.messages.frame_record import FrameRecord, SessionHeader
from dfvs_core.messages.link import PerceptionReport
from dfvs_service.record.follow import RecordSequencer

REPORT = PerceptionReport(0, 0, (0.0,) * 4, False, False, False, "", 0.0, 0.0, 0.0)


def opening(opened_ns, first_turn=0):
    return SessionHeader("v", first_turn, opened_ns, "", 0, {}, {}, {}, {})


def record(number, opened_ns):
    return FrameRecord(number, opened_ns, 0, (), REPORT)


def given(order, *messages):
    return [event[0] for message in messages for event in order.put(message, b"")]


def test_turns_wait_for_their_opening():
    early, late = record(0, 10), record(1, 10)
    assert given(RecordSequencer(), early, late, opening(10)) == [opening(10), early, late]


def test_an_opening_is_passed_on_once_and_only_with_its_first_turn():
    order = RecordSequencer()
    assert given(order, opening(10), opening(10)) == []
    assert given(order, record(0, 10), opening(10), record(1, 10)) == [
        opening(10),
        record(0, 10),
        record(1, 10),
    ]


def test_an_opening_that_overtakes_turns_of_the_one_before_waits_for_its_own():
    order = RecordSequencer()
    given(order, opening(10), record(0, 10))
    assert given(order, opening(20, 2), record(1, 10), record(2, 20)) == [
        record(1, 10),
        opening(20, 2),
        record(2, 20),
    ]


def test_a_service_that_was_started_anew_is_told_apart():
    order = RecordSequencer()
    given(order, opening(10), record(0, 10), record(1, 10))
    assert given(order, record(0, 99), opening(99)) == [opening(99), record(0, 99)]


def test_turns_whose_opening_never_comes_do_not_pile_up():
    order = RecordSequencer()
    given(order, *(record(number, 10) for number in range(10_000)))
    passed_on = given(order, opening(10))
    assert len(passed_on) == 257
    assert passed_on[-1].number == 9_999
