"""Scores of flow against truth, on figures that can be worked out by hand."""

import numpy as np
import pytest

from dfvs_core.errors import ImageError
from dfvs_core.matching.correspondence import FlowField
from dfvs_models.evaluation import score_pair, summarise

ALL = np.ones((1, 4), bool)


def field(errors, confidence):
    """One row of pixels whose flow is wrong by ``errors`` px; the truth is zero."""
    flow = np.multiply.outer(np.array([errors], np.float32), np.array([0.6, -0.8], np.float32))
    return FlowField(flow, np.array([confidence], np.float32))


def truth(width=4):
    return np.zeros((1, width, 2), np.float32)


def test_errors_are_averaged_over_visible_pixels_only():
    visible = np.array([[True, True, True, False]])
    score = score_pair(field([0, 2, 4, 100], [1, 1, 1, 1]), truth(), visible)
    assert score.epe_px == pytest.approx(2.0)
    assert score.under_3px == pytest.approx(2 / 3)


def test_the_more_confident_half_is_scored_by_itself():
    score = score_pair(field([5, 1, 7, 3], [0.1, 0.9, 0.2, 0.8]), truth(), ALL)
    assert score.confident_half_epe_px == pytest.approx(2.0)


@pytest.mark.parametrize(
    ("confidence", "correlation"),
    [([0.9, 0.6, 0.4, 0.1], 1.0), ([0.1, 0.4, 0.6, 0.9], -1.0), ([0.5, 0.5, 0.5, 0.5], 0.0)],
    ids=["honest", "perverse", "silent"],
)
def test_honest_confidence_falls_as_the_error_grows(confidence, correlation):
    score = score_pair(field([0.1, 1, 5, 60], confidence), truth(), ALL)
    assert score.confidence_correlation == pytest.approx(correlation)


def test_sure_pixels_are_wrong_when_far_off_or_not_visible():
    visible = np.array([[True, True, True, False]])
    score = score_pair(field([0, 4, 9, 0], [0.9, 0.9, 0.1, 0.9]), truth(), visible)
    assert score.confident_ratio == pytest.approx(3 / 4)
    assert score.confident_failed == pytest.approx(2 / 3)


def test_a_match_that_failed_and_says_so_does_not_count_as_failed_but_sure():
    boasting = score_pair(field([50] * 4, [0.9] * 4), truth(), ALL)
    modest = score_pair(field([50] * 4, [0.1] * 4), truth(), ALL)
    good = score_pair(field([1] * 4, [0.9] * 4), truth(), ALL)
    assert boasting.confident_failures
    assert not modest.confident_failures
    level = summarise([boasting, modest, good])
    assert level.confident_failures == 1
    assert level.pairs == 3
    assert level.epe_px == pytest.approx(101 / 3)


def test_truth_of_another_size_and_invisible_pairs_are_refused():
    with pytest.raises(ImageError, match="shape"):
        score_pair(field([0] * 4, [1] * 4), truth(5), ALL)
    with pytest.raises(ImageError, match="visible"):
        score_pair(field([0] * 4, [1] * 4), truth(), ~ALL)
