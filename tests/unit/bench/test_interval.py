import math

import pytest

from dfvs_bench.basin.ratios import Share


@pytest.mark.parametrize(
    ("successes", "trials", "low", "high"),
    [
        (81, 263, 0.2553, 0.3662),  # this and the next three: Newcombe, Statistics in Medicine 17
        (15, 148, 0.0624, 0.1605),  # (1998), table I, method 3
        (0, 20, 0.0000, 0.1611),
        (1, 29, 0.0061, 0.1718),
        (16, 16, 0.8064, 1.0),  # full success still has a width
    ],
)
def test_the_interval_is_wilson_s(successes, trials, low, high):
    assert Share(successes, trials).interval == pytest.approx((low, high), abs=5e-5)


def test_nothing_is_known_without_trials():
    assert math.isnan(Share(0, 0).ratio)
    assert Share(0, 0).interval == (0.0, 1.0)
