import pytest

from dfvs_core.messages.frame import NO_CLOCK
from dfvs_service.dashboard.vehicles.clock import Moment, SenderClock

OURS, THEIRS, OTHERS = b"o" * 16, b"t" * 16, b"x" * 16
MS = 1_000_000
S = 1_000 * MS
HOUR = 3_600 * S


def heard(clock, t_ns, now_ns):
    clock.on_state(t_ns, now_ns)
    return clock.age_ns(t_ns, now_ns)


def test_stamps_of_this_machine_s_clock_have_exact_ages():
    clock = SenderClock()
    assert heard(clock, 5_000 * MS, 5_040 * MS) == 40 * MS
    assert heard(clock, 5_100 * MS, 5_103 * MS) == 3 * MS
    assert not clock.is_foreign


def test_a_foreign_clock_counts_the_quickest_message_as_undelayed():
    clock = SenderClock()
    ages = [
        heard(clock, sent, sent + HOUR + delay * MS) for sent, delay in ((0, 30), (9, 20), (99, 55))
    ]
    assert ages == [0, 0, 35 * MS]
    assert clock.is_foreign


@pytest.mark.parametrize("rate", [1 - 50e-6, 1.0, 1 + 50e-6])
def test_a_foreign_clock_of_another_rate_makes_nothing_old(rate):
    clock = SenderClock(OURS)
    clock.identify(THEIRS)
    ages = [heard(clock, int(now * rate), now + 20 * MS) for now in range(0, 12 * HOUR, 10 * S)]
    assert max(ages) < 10 * MS


def test_a_link_that_becomes_slow_makes_messages_old_for_an_hour():
    clock = SenderClock()
    for now in range(0, 2 * HOUR, 10 * S):
        age_ns = heard(clock, now, HOUR + now + (4 * S if now > HOUR else 0))
    assert age_ns > 2 * S


def test_a_sender_that_boots_again_is_young_again():
    clock = SenderClock()
    heard(clock, 2 * HOUR, 3 * HOUR)
    assert heard(clock, 1 * MS, 3 * HOUR + 50 * MS) == 0
    assert heard(clock, 11 * MS, 3 * HOUR + 70 * MS) == 10 * MS


def test_a_foreign_state_that_is_later_than_ever_before_is_old():
    clock = SenderClock()
    heard(clock, 2 * HOUR, 3 * HOUR)
    assert heard(clock, 2 * HOUR + 1, 3 * HOUR + 15 * S + 1) == 15 * S


def test_a_state_of_this_machine_that_is_late_is_old_and_not_foreign():
    clock = SenderClock()
    heard(clock, HOUR, HOUR + 3 * MS)
    assert heard(clock, HOUR + 1, HOUR + 15 * S + 1) == 15 * S
    assert not clock.is_foreign


def test_a_state_of_this_machine_that_comes_after_newer_ones_is_old():
    clock = SenderClock()
    heard(clock, HOUR, HOUR + 3 * MS)
    assert heard(clock, HOUR - 12 * S, HOUR + 4 * MS) == 12 * S + 4 * MS


def test_a_frame_that_is_older_than_the_state_is_no_boot():
    clock = SenderClock()
    heard(clock, 2 * HOUR, 3 * HOUR)
    clock.on_message(2 * HOUR - 15 * S, 3 * HOUR)
    assert clock.age_ns(2 * HOUR - 15 * S, 3 * HOUR) == 15 * S


def test_a_clock_that_is_known_to_be_this_machine_s_has_exact_ages_however_old():
    clock = SenderClock(OURS)
    heard(clock, 0, HOUR)
    clock.identify(OURS)
    assert not clock.is_foreign
    assert heard(clock, 0, HOUR) == HOUR
    assert heard(clock, 2 * HOUR, HOUR) == 0


def test_a_clock_that_is_known_to_be_another_machine_s_is_foreign_though_it_reads_alike():
    clock = SenderClock(OURS)
    clock.identify(THEIRS)
    heard(clock, 0, 5_000 * MS)
    assert clock.is_foreign
    assert clock.age_ns(0, 5_003 * MS) == 3 * MS


def test_a_sender_with_another_clock_is_measured_anew():
    clock = SenderClock(OURS)
    clock.identify(THEIRS)
    heard(clock, 5 * S, HOUR)
    clock.identify(OTHERS)
    assert heard(clock, 20 * S, 2 * HOUR) == 0


def test_a_frame_that_names_no_clock_tells_nothing():
    clock = SenderClock(OURS)
    clock.identify(OURS)
    clock.identify(NO_CLOCK)
    assert heard(clock, 0, HOUR) == HOUR


def test_stamps_from_the_future_are_foreign_and_never_of_negative_age():
    clock = SenderClock()
    assert heard(clock, HOUR, 0) == 0
    assert heard(clock, HOUR + 5 * MS, 2 * MS) == 0
    assert clock.is_foreign


def test_a_stamp_becomes_wall_clock_time():
    assert SenderClock().wall_ms(1_000 * MS, Moment(1_250 * MS, 50_000.0)) == 49_750.0
