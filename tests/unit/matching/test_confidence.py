"""Confident parts of flow fields: merged, and excluded."""

import numpy as np

from dfvs_core.matching.config import MatchingConfig
from dfvs_core.matching.correspondence import (
    FlowField,
    confident_ratio,
    empty_flow,
    exclude,
    merge_by_confidence,
)
from dfvs_core.matching.points import PointMatches, is_excluded

SIZE = (40, 60)
CONFIG = MatchingConfig()


def field(du_px, confidence=1.0):
    """Flow to the right; its confidence is a number, or (W,) by columns."""
    by_column = np.broadcast_to(np.asarray(confidence, np.float32), SIZE)
    return FlowField(np.full((*SIZE, 2), (du_px, 0.0), np.float32), by_column.copy())


def columns(first, last, confidence=1.0):
    """Confidence (W,) of some columns."""
    found = np.zeros(SIZE[1], np.float32)
    found[first:last] = confidence
    return found


def test_the_confident_ratio_counts_what_is_likelier_right_than_wrong():
    assert confident_ratio(field(0.0, columns(0, 15, 0.6) + columns(15, 60, 0.5))) == 0.25


def test_an_empty_flow_has_no_confidence():
    empty = empty_flow(SIZE)
    assert empty.is_finite()
    assert confident_ratio(empty) == 0.0


def test_each_pixel_is_taken_from_the_more_confident_flow():
    first, second = field(1.0, columns(0, 20, 0.9)), field(2.0, columns(10, 40, 0.6))
    merged = merge_by_confidence(first, second)
    np.testing.assert_array_equal(merged.flow[0, :20, 0], 1.0)
    np.testing.assert_array_equal(merged.flow[0, 20:40, 0], 2.0)
    np.testing.assert_array_equal(merged.confidence[0], columns(0, 20, 0.9) + columns(20, 40, 0.6))


def test_an_excluded_flow_takes_the_confidence_of_what_leads_to_the_same_places():
    mixed = merge_by_confidence(field(5.0, columns(0, 30)), field(20.0, columns(30, 60)))
    for excluded, kept in [
        ([], columns(0, 60)),
        ([field(6.0)], columns(30, 60)),
        ([field(6.0), field(22.0)], columns(0, 0)),
    ]:
        np.testing.assert_array_equal(exclude(mixed, excluded, CONFIG).confidence[7], kept)
    assert mixed.confidence.min() == 1.0


def test_matches_that_follow_an_excluded_flow_are_dropped():
    at = np.array([[10.0, 10.0], [20.3, 20.0], [59.6, 39.6], [-0.4, -0.4]], np.float32)
    moved = np.array([[5.0, 0.0], [20.0, 0.0], [5.5, 0.0], [5.0, 3.5]], np.float32)
    matches = PointMatches(at, at + moved, np.array([0.1, 0.2, 0.3, 0.4], np.float32))
    left = matches.select(~is_excluded(matches, [field(5.0)], CONFIG))
    np.testing.assert_array_equal(left.confidence, np.float32([0.2, 0.4]))
    assert is_excluded(matches, [field(5.0), field(20.0)], CONFIG).sum() == 3
    assert not is_excluded(matches, [], CONFIG).any()
