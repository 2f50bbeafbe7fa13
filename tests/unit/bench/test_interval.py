import math

import pytest

from dfvs_bench.basin.ratios import Share


@pytest.mark.parametrize(
    ("successes", "trials", "low", "high"),
    [
        # Newcombe, Statistics in Medicine 17 (1998), table I, method 3
        (81, 263, 0.2553, 0.3662),
        (15, 148, 0.0624, 0.1605),
        (0, 20, 0.0000, 0.1611),
        (1, 29, 0.0061, 0.1718),
    ],
)
def test_the_interval_is_wilson_s(successes, trials, low, high):
    assert Share(successes, trials).interval == pytest.approx((low, high), abs=5e-5)


def test_full_success_still_has_a_width():
    low, high = Share(16, 16).interval
    assert high == pytest.approx(1.0)
    assert low == pytest.approx(0.8064, abs=5e-5)


def test_nothing_is_known_without_trials():
    assert math.isnan(Share(0, 0).ratio)
    assert Share(0, 0).interval == (0.0, 1.0)
