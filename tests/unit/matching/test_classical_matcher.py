"""The classical matcher on pictures of a textured wall, where the flow is known exactly."""

import cv2
import numpy as np
import pytest
from textured_wall import HEIGHT, WIDTH, Wall, errors, exact_flow, inside, texture, turned

from dfvs_core.matching.classical import classical_matcher
from dfvs_core.matching.correspondence import FlowField, confident_ratio
from dfvs_core.matching.matcher import track_or_match

MATCHER = classical_matcher()
CONFIDENT = np.ones((HEIGHT, WIDTH), np.float32)
FAR = turned(roll_deg=35.0, zoom=1.25, shift=(30.0, -20.0), perspective=(4e-4, -3e-4))


@pytest.fixture(scope="module")
def wall():
    return Wall(texture(np.random.default_rng(7)))


def match(a, b, predicted=None):
    return track_or_match(MATCHER, MATCHER.encode(a), MATCHER.encode(b), predicted)


def test_a_picture_matches_itself_without_motion_and_without_doubt(wall):
    field = match(wall.picture(), wall.picture())
    assert np.abs(field.flow).max() < 0.1
    assert confident_ratio(field) > 0.98


@pytest.mark.parametrize(
    ("H", "gain", "offset"),
    [
        (FAR, 1.0, 0.0),
        (FAR, 0.6, 25.0),
        (turned(roll_deg=-50.0), 1.0, 0.0),
        (turned(zoom=1.6), 1.0, 0.0),
        (turned(shift=(90.0, 40.0)), 1.0, 0.0),
        (turned(perspective=(1.2e-3, 6e-4)), 1.0, 0.0),
    ],
    ids=["all at once", "another exposure", "roll", "zoom", "shift", "perspective"],
)
def test_large_motion_is_bridged(wall, H, gain, offset):
    truth = exact_flow(H)
    field = match(wall.picture(), wall.picture(H, gain, offset))
    visible = inside(truth, margin=8.0)
    error = errors(field, truth)
    assert np.mean(error[visible] < 1.0) > 0.97
    assert np.mean(field.confidence[visible] > 0.5) > 0.85


@pytest.mark.parametrize("greys", [(128, 128), (40, 220), (0, 0)])
def test_featureless_pictures_give_no_confidence_at_all(greys):
    a, b = (np.full((HEIGHT, WIDTH, 3), g, np.uint8) for g in greys)
    field = match(a, b)
    assert field.is_finite()
    assert field.confidence.max() == 0.0


def test_noise_gives_no_confidence(rng):
    a, b = (
        np.clip(rng.normal(128, 6, (HEIGHT, WIDTH, 3)), 0, 255).astype(np.uint8) for _ in range(2)
    )
    assert match(a, b).confidence.max() == 0.0


@pytest.mark.parametrize("seed", range(4))
def test_pictures_of_different_places_give_no_confidence(seed):
    rng = np.random.default_rng(100 + seed)
    field = match(Wall(texture(rng)).picture(), Wall(texture(rng)).picture())
    assert field.confidence.max() == 0.0


def test_the_same_pictures_give_the_same_bits(wall):
    first = match(wall.picture(), wall.picture(FAR))
    np.random.default_rng(0).normal(size=10)
    cv2.setRNGSeed(12345)
    second = match(wall.picture(), wall.picture(FAR))
    assert first.flow.tobytes() == second.flow.tobytes()
    assert first.confidence.tobytes() == second.confidence.tobytes()


def test_a_good_prediction_gives_the_same_flow_and_spares_the_features(wall):
    truth = exact_flow(FAR)
    relocalised = match(wall.picture(), wall.picture(FAR))
    current, other = MATCHER.encode(wall.picture()), MATCHER.encode(wall.picture(FAR))
    tracked = track_or_match(MATCHER, current, other, relocalised)
    visible = inside(truth, margin=8.0)
    difference = np.linalg.norm(tracked.flow - relocalised.flow, axis=-1)[visible]
    assert np.mean(difference < 0.2) > 0.93
    error_px, expected_px = (
        errors(field, truth)[visible].mean() for field in (tracked, relocalised)
    )
    assert error_px < 1.1 * expected_px + 0.02
    assert current._features is None
    assert other._features is None


def test_tracking_follows_a_camera_that_moves_on(wall):
    """Ten frames of 4 px and 1.5 degrees each, every flow the prediction of the next."""
    goal = MATCHER.encode(wall.picture())
    field, ratios = None, []
    for k in range(10, 0, -1):
        H_goal_frame = turned(roll_deg=1.5 * k, shift=(4.0 * k, -2.0 * k))
        frame = MATCHER.encode(wall.picture(H_goal_frame))
        field = track_or_match(MATCHER, frame, goal, field)
        ratios.append(confident_ratio(field))
        if k < 10:
            assert frame._features is None
    truth = exact_flow(np.linalg.inv(turned(roll_deg=1.5, shift=(4.0, -2.0))))
    assert errors(field, truth)[inside(truth, margin=8.0)].mean() < 0.15
    assert min(ratios) > 0.6


def test_a_useless_prediction_does_not_hold_and_changes_no_bit(wall):
    predicted = FlowField(np.full((HEIGHT, WIDTH, 2), 25.0, np.float32), CONFIDENT)
    current, other = MATCHER.encode(wall.picture()), MATCHER.encode(wall.picture(FAR))
    assert MATCHER.track(current, other, predicted) is None
    misled = track_or_match(MATCHER, current, other, predicted)
    assert misled.flow.tobytes() == MATCHER.match(current, other).flow.tobytes()


def test_small_pictures_work_too(wall):
    a, b = (cv2.resize(wall.picture(H), (212, 160)) for H in (None, turned(shift=(30.0, 0.0))))
    field = match(a, b)
    sure = field.confidence > 0.5
    assert sure.mean() > 0.6
    np.testing.assert_allclose(field.flow[sure].mean(axis=0), [30.0 * 212 / 320, 0.0], atol=0.1)
