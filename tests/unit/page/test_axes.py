"""Axes of charts: whatever the values are, they lie inside, in their order, and there are ticks."""

import math

import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from dfvs_service.page.axes import linear_axis, log_axis, nice_step, tolerance_axis

VALUES = st.floats(-1e6, 1e6)
POSITIVE = st.floats(1e-6, 1e6)
ROUNDING = 1e-6


@given(VALUES, VALUES)
def test_a_linear_axis_holds_its_range(a, b):
    low, high = min(a, b), max(a, b)
    axis = linear_axis(low, high)
    assert -ROUNDING <= axis.share(low) <= axis.share(high) <= 1 + ROUNDING
    assert len(axis.ticks) == 5


@given(POSITIVE, POSITIVE)
@example(10.0, 10.0)
def test_a_logarithmic_axis_holds_its_range_and_has_two_ticks_or_more(a, b):
    low, high = min(a, b), max(a, b)
    axis = log_axis(low, high)
    assert axis.low <= low * (1 + ROUNDING)
    assert axis.high >= high * (1 - ROUNDING)
    assert len(axis.ticks) >= 2 or high / low < 10
    assert axis.share(math.sqrt(axis.low * axis.high)) == pytest.approx(0.5)


@pytest.mark.parametrize("value", [1e-3, 20.0, 50.0, 100.0])
def test_a_logarithmic_axis_of_one_value_has_a_range(value):
    assert log_axis(value, value).share(value) == 0.0


@given(st.lists(st.floats(0.0, 1e3), min_size=1), st.floats(1e-3, 10.0))
def test_an_axis_around_a_tolerance_shows_values_on_either_side_of_it(values, tolerance):
    axis = tolerance_axis(values, tolerance)
    assert 0 < axis.share(tolerance) < 1
    for value in values:
        assert 0 <= axis.share(value) <= 1
        assert (axis.share(value) > axis.share(tolerance)) == (value > tolerance)


@given(st.floats(1e-9, 1e9))
def test_a_step_is_no_less_than_asked_and_less_than_three_times_as_much(value):
    step = nice_step(value)
    assert value * (1 - ROUNDING) <= step < 3 * value
