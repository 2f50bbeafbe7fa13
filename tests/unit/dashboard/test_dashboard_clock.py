from dfvs_service.dashboard.vehicles.clock import Moment, SenderClock

MS = 1_000_000
HOUR = 3_600_000 * MS


def test_stamps_of_this_machine_s_clock_have_exact_ages():
    clock = SenderClock()
    assert clock.age_ns(5_000 * MS, 5_040 * MS) == 40 * MS
    assert clock.age_ns(5_100 * MS, 5_103 * MS) == 3 * MS
    assert not clock.is_foreign


def test_a_foreign_clock_counts_the_quickest_message_as_undelayed():
    clock = SenderClock()
    ages = [
        clock.age_ns(sent, sent + HOUR + delay * MS) for sent, delay in ((0, 30), (9, 20), (99, 55))
    ]
    assert ages == [0, 0, 35 * MS]
    assert clock.is_foreign


def test_a_sender_that_boots_again_is_young_again():
    clock = SenderClock()
    clock.age_ns(2 * HOUR, 3 * HOUR)
    assert clock.age_ns(1 * MS, 3 * HOUR + 50 * MS) == 0
    assert clock.age_ns(11 * MS, 3 * HOUR + 70 * MS) == 10 * MS


def test_stamps_from_the_future_are_foreign_and_never_of_negative_age():
    clock = SenderClock()
    assert clock.age_ns(HOUR, 0) == 0
    assert clock.age_ns(HOUR + 5 * MS, 2 * MS) == 0
    assert clock.is_foreign


def test_a_stamp_becomes_wall_clock_time():
    assert SenderClock().wall_ms(1_000 * MS, Moment(1_250 * MS, 50_000.0)) == 49_750.0
