import pytest

from dfvs_service.dashboard.vehicles.rates import StreamRate

S = 1_000_000_000


def steady(hz, seconds, size=10):
    rate = StreamRate()
    for i in range(int(hz * seconds)):
        rate.note(int(i * S / hz), size, i)
    return rate


def test_rate_and_load_are_those_of_the_last_two_seconds():
    summary = steady(20, 10, 100).summary(10 * S)
    assert summary["hz"] == pytest.approx(20, abs=0.6)
    assert summary["bytes_s"] == pytest.approx(2000, abs=60)
    assert summary["count"] == 200
    assert summary["missing"] == 0


def test_a_stream_that_stops_has_no_rate_and_grows_old():
    summary = steady(20, 2).summary(12 * S)
    assert summary["hz"] == 0
    assert summary["age_s"] == pytest.approx(10.05)


def test_a_stream_that_never_came_has_no_age():
    assert StreamRate().summary(5 * S)["age_s"] is None


def test_what_the_numbering_skips_is_missing():
    rate = StreamRate()
    for i, seq in enumerate((5, 6, 9, 10)):
        rate.note(i, 1, seq)
    assert rate.missing == 2


def test_what_was_replaced_here_is_not_missing():
    rate = StreamRate()
    rate.note(0, 1, 5)
    rate.note(1, 1, 9, replaced=1)
    rate.note(2, 1, 10, replaced=4)
    rate.note(3, 1, 12)
    assert rate.missing == 3


@pytest.mark.parametrize(("t_ns", "seq"), [(2 * S, 40), (1, 3), (1, 100_000)])
def test_a_pause_or_a_new_sender_loses_nothing(t_ns, seq):
    rate = StreamRate()
    rate.note(0, 1, 7)
    rate.note(t_ns, 1, seq)
    assert rate.missing == 0
