"""The feature error of the same features: steady while what is matched changes."""

import numpy as np
import pytest

from dfvs_core.servo.checks.feature_error import by_cell, feature_error
from dfvs_core.servo.points import ServoPoints

CELL = 0.03
GRID = np.stack(np.meshgrid(np.arange(-20, 20), np.arange(-15, 15)), axis=-1).reshape(-1, 2)
GOAL = (GRID + 0.5) * CELL
FLOW = np.column_stack([0.3 + 0.2 * GOAL[:, 0], 0.1 * GOAL[:, 1]])
"""An error that is a different one in every part of the picture."""


def seen(share, keep=None, weight=1.0):
    """Features of the cells ``keep``, a ``share`` of their error left."""
    keep = np.ones(len(GOAL), bool) if keep is None else keep
    goal = GOAL[keep]
    n = len(goal)
    return ServoPoints(goal + share * FLOW[keep], goal, np.ones(n), weight * np.ones(n), np.ones(n))


def columns(first, last):
    return (GRID[:, 0] >= first) & (GRID[:, 0] < last)


def compared(points, reference):
    return feature_error(points, CELL, reference)


def own_length(points):
    return compared(points, None)[0]


def test_without_a_reference_it_is_the_median_of_the_frame():
    lengths = np.linalg.norm(FLOW, axis=1)
    length, reference = compared(seen(1.0), None)
    assert length == pytest.approx(np.median(lengths), rel=1e-2)
    assert reference.length == length


def test_what_comes_into_view_and_leaves_it_changes_nothing():
    start, reference = compared(seen(1.0, columns(-20, 5)), None)
    now = seen(0.98, columns(-12, 20))
    length, kept = compared(now, reference)
    assert kept is reference
    assert length / start == pytest.approx(0.98, rel=1e-6)
    assert own_length(now) > 1.05 * start  # which the frame alone would call further away


def test_flying_away_shows():
    start, reference = compared(seen(1.0), None)
    assert compared(seen(1.02), reference)[0] == pytest.approx(1.02 * start, rel=1e-6)


def test_a_few_wild_features_decide_nothing():
    start, reference = compared(seen(1.0), None)
    now = seen(0.98)
    now.xy[::7] += 0.5
    assert compared(now, reference)[0] == pytest.approx(0.98 * start, rel=1e-6)


def test_it_goes_on_with_another_reference_where_half_is_out_of_view():
    start, reference = compared(seen(1.0, columns(-20, 10)), None)
    length, renewed = compared(seen(0.8, columns(-2, 20)), reference)
    assert renewed is not reference
    assert length / start == pytest.approx(0.8, rel=1e-6)
    length, kept = compared(seen(0.6, columns(0, 20)), renewed)
    assert kept is renewed
    assert length / start == pytest.approx(0.6, rel=1e-6)


def test_it_begins_anew_where_nearly_nothing_is_common():
    _, reference = compared(seen(1.0, columns(-20, 0)), None)
    now = seen(1.0, columns(-1, 20))
    assert compared(now, reference)[0] == own_length(now)
    now = seen(1.0, columns(0, 20))
    assert compared(now, reference)[0] == own_length(now)


def test_an_error_of_nothing_is_no_measure_for_others():
    length, reference = compared(seen(0.0), None)
    assert length == 0.0
    assert compared(seen(1.0), reference)[0] == own_length(seen(1.0))


@pytest.mark.parametrize("scale", [0.5, 0.9, 1.5, 3.0])
def test_from_far_away_the_samples_still_fall_into_the_same_cells(scale):
    """There the goal picture shows them further apart than they are in the view."""

    def view(scale, shift):
        xy = (GRID + shift) * CELL
        n = len(xy)
        return ServoPoints(xy, xy * scale, np.ones(n), np.ones(n), np.ones(n))

    _, reference = compared(view(scale, 0.0), None)
    for shift in (0.2, 0.5, 0.8):
        assert compared(view(1.01 * scale, shift), reference)[1] is reference


def test_what_counts_for_nothing_makes_no_cell():
    points = seen(1.0)
    points.weight[columns(-20, 0)] = 0.0
    cells = by_cell(points, CELL)
    assert len(cells.cell) == np.count_nonzero(points.weight)
    assert np.isfinite(cells.error).all()
