from hypothesis import given
from hypothesis import strategies as st

from dfvs_core.messages.rate_limit import Rate, RateLimit

S = 1_000_000_000


def test_a_burst_is_let_through_and_no_more():
    limit = RateLimit(Rate(per_s=2.0, burst=3), 0)
    assert [limit.admits(0) for _ in range(5)] == [True, True, True, False, False]
    assert limit.dropped == 2


def test_what_was_used_comes_back_at_the_rate():
    limit = RateLimit(Rate(per_s=2.0, burst=1), 0)
    assert limit.admits(0)
    assert not limit.admits(S // 2 - 1)
    assert limit.admits(S // 2)


def test_a_long_quiet_time_gives_one_burst_only():
    limit = RateLimit(Rate(per_s=10.0, burst=3), 0)
    assert [limit.admits(3600 * S) for _ in range(4)] == [True, True, True, False]


def test_a_clock_that_goes_back_gives_nothing():
    limit = RateLimit(Rate(per_s=1.0, burst=1), 10 * S)
    assert limit.admits(10 * S)
    assert not limit.admits(0)
    assert not limit.admits(10 * S)
    assert limit.admits(11 * S)


@given(st.lists(st.integers(0, 10 * S), max_size=200), st.floats(0.5, 50.0), st.integers(1, 20))
def test_never_more_than_burst_and_rate_allow(times, per_s, burst):
    limit = RateLimit(Rate(per_s, burst), 0)
    times.sort()
    admitted = [t for t in times if limit.admits(t)]
    for i, first in enumerate(admitted):
        for j in range(i, len(admitted)):
            allowed = burst + per_s * (admitted[j] - first) / S
            assert j - i + 1 <= allowed + 1e-6
    assert len(admitted) + limit.dropped == len(times)
