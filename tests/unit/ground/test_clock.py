"""The vehicle's clock, told by its stamps, on this machine's."""

import numpy as np
import pytest

from dfvs_sim.ground.clock import ClockMap

MS = 1_000_000
BOOT_NS = 7_000_000_000
"""Local time at which the vehicle's clock was zero."""


def test_the_smallest_delay_of_late_tells_the_difference_of_the_clocks() -> None:
    clock = ClockMap()
    for i, delay_ms in enumerate((30, 12, 3, 25, 18)):
        clock.update(i * 20 * MS, BOOT_NS + i * 20 * MS + delay_ms * MS)
    assert clock.offset_ns == BOOT_NS + 3 * MS


def test_the_offset_does_not_jump_when_a_window_ends() -> None:
    clock = ClockMap()
    offsets = []
    for i in range(12 * 50):
        delay_ms = 1 if i % 50 == 7 else 20
        clock.update(i * 20 * MS, BOOT_NS + (i * 20 + delay_ms) * MS)
        offsets.append(clock.offset_ns)
    assert set(offsets[50:]) == {BOOT_NS + 1 * MS}


@pytest.mark.parametrize("rate", [0.5, 0.6, 0.8, 0.9, 0.99, 0.999, 1.0, 1.01, 1.2])
@pytest.mark.parametrize("delay_ms", [1.0, 20.0])
def test_a_clock_of_another_rate_is_followed(rate: float, delay_ms: float) -> None:
    clock, rng = ClockMap(), np.random.default_rng(0)
    errors_ms = []
    for i in range(30 * 50):  # 30 s at 50 Hz, each message late by up to delay_ms
        made_ns = BOOT_NS + i * 20 * MS
        stamp_ns = round(i * 20 * MS * rate)
        assert not clock.update(stamp_ns, made_ns + round(delay_ms * MS * rng.random()))
        errors_ms.append((clock.offset_ns - (made_ns - stamp_ns)) / MS)
    # the first 4 s tell the rate; then a share of the delay's jitter is left
    assert max(abs(e) for e in errors_ms[200:]) < 15.0
    assert abs(float(np.mean(errors_ms[200:]))) < 2.0
    assert clock.simulation_rate == pytest.approx(rate, abs=0.02)


@pytest.mark.parametrize("rate", [0.1, 0.3])
def test_a_rate_below_what_is_followed_is_no_restart_and_its_error_is_bounded(rate: float) -> None:
    clock = ClockMap()
    for i in range(30 * 50):
        stamp_ns = round(i * 20 * MS * rate)
        assert not clock.update(stamp_ns, BOOT_NS + i * 20 * MS)
    assert abs(clock.offset_ns - (BOOT_NS + i * 20 * MS - stamp_ns)) < 4000 * MS


@pytest.mark.parametrize("stop_ms", [150, 400, 900])
def test_a_simulation_that_stood_still_once_is_followed_again(stop_ms: int) -> None:
    clock = ClockMap()
    errors_ms = []
    for i in range(20 * 50):
        made_ns = BOOT_NS + (i * 20 + (stop_ms if i >= 500 else 0)) * MS
        clock.update(i * 20 * MS, made_ns)
        errors_ms.append((clock.offset_ns - (made_ns - i * 20 * MS)) / MS)
    assert max(errors_ms) < 1.0  # never takes the vehicle for older than its newest message
    assert max(abs(e) for e in errors_ms[500 + 5 * 50 :]) < 1.0


def test_messages_that_queued_up_do_not_move_the_offset() -> None:
    clock = ClockMap()
    for i in range(20 * 50):
        held_ms = max(0, 700 - (i - 500) * 20) if i >= 500 else 0
        clock.update(i * 20 * MS, BOOT_NS + (i * 20 + held_ms) * MS)
        if i > 100:
            assert clock.offset_ns == BOOT_NS


def test_a_slow_vehicle_that_starts_anew_is_noticed() -> None:
    clock = ClockMap()
    for i in range(500):
        clock.update(i * 20 * MS, BOOT_NS + i * 33 * MS)
    arrival_ns = BOOT_NS + 500 * 33 * MS
    assert clock.update(0, arrival_ns)
    assert clock.offset_ns == arrival_ns
    assert clock.simulation_rate is None
    assert clock.local_ns(1000 * MS) == arrival_ns + 1000 * MS  # its rate is not known yet
