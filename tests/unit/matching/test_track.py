"""Tracking by a predicted flow: when it holds, and how precise it is."""

import cv2
import numpy as np
import pytest
from textured_wall import HEIGHT, WIDTH, Wall, errors, exact_flow, inside, texture, turned

from dfvs_core.matching.config import MatchingConfig
from dfvs_core.matching.correspondence import FlowField, empty_flow
from dfvs_core.matching.points import NO_MATCHES
from dfvs_core.matching.smooth_flow import confident_matches
from dfvs_core.matching.track import extend, track
from dfvs_core.matching.warping import pixel_grid

CONFIG, SIZE = MatchingConfig(), (HEIGHT, WIDTH)
MOTION = turned(roll_deg=20.0, zoom=1.1, shift=(20.0, -10.0))
TRUTH = exact_flow(MOTION)
VISIBLE = inside(TRUTH, margin=8.0)
PART = np.zeros(SIZE, np.float32)
PART[90:150, 130:190] = 1.0


@pytest.fixture(scope="module")
def walls():
    return [Wall(texture(np.random.default_rng(seed))) for seed in (7, 8)]


@pytest.fixture(scope="module")
def frame(walls):
    return cv2.cvtColor(walls[0].picture(), cv2.COLOR_RGB2GRAY)


def goal(walls, hidden_ratio=0.0):
    """The wall after the motion, with another one in front of its left part."""
    picture = walls[0].picture(MOTION)
    hidden_px = round(WIDTH * hidden_ratio)
    picture[:, :hidden_px] = walls[1].picture()[:, :hidden_px]
    return cv2.cvtColor(picture, cv2.COLOR_RGB2GRAY)


def prediction(error=None, confidence=1.0):
    """The true flow followed by a homography that it is wrong by."""
    H = MOTION if error is None else error @ MOTION
    return FlowField(exact_flow(H).astype(np.float32), np.full(SIZE, confidence, np.float32))


@pytest.mark.parametrize(
    "error",
    [None, turned(shift=(4.0, -2.0)), turned(roll_deg=1.5, shift=(3.0, 0.0)), turned(zoom=1.03)],
    ids=["exact", "shift", "roll", "zoom"],
)
def test_a_prediction_of_the_frame_before_is_made_precise(walls, frame, error):
    field = track(frame, goal(walls), prediction(error), CONFIG)
    assert np.mean(errors(field, TRUTH)[VISIBLE] < 1.0) > 0.98
    assert errors(field, TRUTH)[VISIBLE].mean() < 0.2
    assert np.mean(field.confidence[VISIBLE] > 0.5) > 0.7


def test_a_rough_prediction_is_searched_from_twice(walls, frame):
    """At 4 degrees the first search finds the rim of the image too far from its median motion."""
    field = track(frame, goal(walls), prediction(turned(roll_deg=4.0)), CONFIG)
    assert np.mean(errors(field, TRUTH)[VISIBLE] < 1.0) > 0.98
    assert np.mean(field.confidence[VISIBLE] > 0.5) > 0.95


def test_a_part_that_was_confident_grows_to_all_that_is_in_view(walls, frame):
    field = track(frame, goal(walls), FlowField(prediction().flow, PART), CONFIG)
    assert np.mean(field.confidence[VISIBLE] > 0.5) > 0.95


def test_only_confident_vectors_of_the_prediction_count(walls, frame):
    exact = prediction()
    flow, confidence = exact.flow.copy(), exact.confidence.copy()
    flow[:, 160:], confidence[:, 160:] = 70.0, 0.0
    field = track(frame, goal(walls), FlowField(flow, confidence), CONFIG)
    assert np.mean(errors(field, TRUTH)[VISIBLE] < 1.0) > 0.98


@pytest.mark.parametrize(
    ("hidden_ratio", "confidence", "holds"),
    [(0.5, 1.0, True), (0.7, 1.0, False), (0.7, 0.5, True), (0.95, 0.5, False)],
)
def test_it_holds_while_enough_is_seen_of_what_was_confident(
    walls, frame, hidden_ratio, confidence, holds
):
    """Of a mere guess, whose confidence is one half, a twentieth of the image is enough."""
    field = track(frame, goal(walls, hidden_ratio), prediction(None, confidence), CONFIG)
    assert (field is not None) == holds


def test_what_is_hidden_has_no_confidence(walls, frame):
    field = track(frame, goal(walls, 0.4), prediction(), CONFIG)
    at_u = np.arange(WIDTH) + TRUTH[..., 0]
    hidden = VISIBLE & (at_u < 0.4 * WIDTH - 16)
    assert np.mean(field.confidence[hidden] > 0.5) < 0.05
    assert np.mean(field.confidence[VISIBLE & (at_u > 0.4 * WIDTH + 16)] > 0.5) > 0.9


@pytest.mark.parametrize(
    "predicted",
    [
        prediction(turned(shift=(120.0, 60.0))),
        empty_flow(SIZE),
        FlowField(np.full((*SIZE, 2), np.nan, np.float32), np.ones(SIZE, np.float32)),
        FlowField(np.zeros((60, 80, 2), np.float32), np.ones((60, 80), np.float32)),
    ],
    ids=["wrong", "without confidence", "not finite", "of another size"],
)
def test_a_useless_prediction_does_not_hold(walls, frame, predicted):
    assert track(frame, goal(walls), predicted, CONFIG) is None


def test_another_place_does_not_hold(walls, frame):
    other = cv2.cvtColor(walls[1].picture(), cv2.COLOR_RGB2GRAY)
    assert track(frame, other, prediction(), CONFIG) is None


def test_the_prediction_is_left_as_it_was(walls, frame):
    predicted = prediction()
    kept = predicted.flow.copy(), predicted.confidence.copy()
    track(frame, goal(walls), predicted, CONFIG)
    np.testing.assert_array_equal(predicted.flow, kept[0])
    np.testing.assert_array_equal(predicted.confidence, kept[1])


def few(matches, count=60):
    """As many of the matches, anywhere in the image."""
    return matches.select(np.random.default_rng(3).permutation(len(matches))[:count])


POINT = FlowField(
    (np.array([80.0, 60.0]) - pixel_grid(SIZE)).astype(np.float32), np.ones(SIZE, np.float32)
)


def true_matches():
    seen = FlowField(prediction().flow, VISIBLE.astype(np.float32))
    return confident_matches(seen)


def test_sparse_matches_lead_out_of_a_false_lock_that_tracking_stays_in(walls, frame):
    """As on one of several things that are alike."""
    wrong = FlowField(np.full((*SIZE, 2), (40.0, 25.0), np.float32), PART)
    found = extend(frame, goal(walls), wrong, lambda *_: few(true_matches(), 200), CONFIG)
    assert np.mean(errors(found, TRUTH)[VISIBLE] < 1.0) > 0.98
    assert np.mean(found.confidence[VISIBLE] > 0.5) > 0.9


def test_sparse_matches_are_asked_for_at_the_turn_and_scale_of_the_known_flow(walls, frame):
    asked = []

    def expected(turn_rad, scale):
        asked.append((np.degrees(turn_rad), scale))
        return few(true_matches())

    field = extend(frame, goal(walls), prediction(), expected, CONFIG)
    assert asked == [pytest.approx((20.0, 1.1), abs=0.05)]
    assert np.mean(field.confidence[VISIBLE] > 0.5) > 0.95


@pytest.mark.parametrize(
    ("known", "matches"),
    [(empty_flow(SIZE), None), (prediction(), NO_MATCHES), (POINT, None)],
    ids=["nothing is known", "nothing else matches", "all leads to one point"],
)
def test_there_is_nothing_to_extend(walls, frame, known, matches):
    assert extend(frame, goal(walls), known, lambda *_: matches, CONFIG) is None
