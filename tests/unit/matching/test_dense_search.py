"""Dense search around a predicted flow, and the confidence of what it finds."""

import cv2
import numpy as np
import pytest
from textured_wall import HEIGHT, WIDTH, Wall, errors, exact_flow, inside, texture, turned

from dfvs_core.matching.config import PATCH_PX, MatchingConfig
from dfvs_core.matching.dense_search import (
    forward_backward_consistency,
    normalised_cross_correlation,
    search_residual,
)

CONFIG, SIZE = MatchingConfig(), (HEIGHT, WIDTH)
STANDSTILL = np.zeros((*SIZE, 2), np.float32)


@pytest.fixture(scope="module")
def wall():
    return Wall(texture(np.random.default_rng(7)))


def grey(picture):
    return cv2.cvtColor(picture, cv2.COLOR_RGB2GRAY)


def search(a, b, predicted=STANDSTILL):
    return search_residual(grey(a), grey(b), predicted, CONFIG)


def checks(contrast_grey, size=SIZE):
    """Squares of 4 px, of two greys about 128."""
    odd = np.indices(size).sum(axis=0) // 4 % 2 == 1
    return np.where(odd, 128 + contrast_grey, 128 - contrast_grey).astype(np.uint8)


@pytest.mark.parametrize("shift", [(3.0, -2.0), (8.0, 4.0)])
def test_small_motion_is_found_from_standstill(wall, shift):
    truth = exact_flow(turned(shift=shift))
    field = search(wall.picture(), wall.picture(turned(shift=shift)))
    visible = inside(truth, margin=8.0)
    assert errors(field, truth)[visible].mean() < 0.05
    assert np.mean(field.confidence[visible] > 0.5) > 0.99


def test_large_motion_is_found_around_its_prediction(wall):
    """The prediction is 3 px and one degree off, the motion many times that."""
    H = turned(roll_deg=40.0, zoom=1.2, shift=(30.0, -20.0))
    predicted = exact_flow(turned(roll_deg=1.0, shift=(2.0, 2.0)) @ H).astype(np.float32)
    field = search(wall.picture(), wall.picture(H), predicted)
    truth = exact_flow(H)
    visible = inside(truth, margin=8.0)
    assert errors(field, truth)[visible].mean() < 0.2
    assert np.mean(field.confidence[visible] > 0.5) > 0.95


@pytest.mark.parametrize(("gain", "offset"), [(0.6, 25.0), (0.5, 0.0), (1.4, -20.0)])
def test_another_brightness_changes_little(wall, gain, offset):
    H = turned(shift=(3.0, -2.0))
    field = search(wall.picture(), wall.picture(H, gain, offset))
    truth = exact_flow(H)
    visible = inside(truth, margin=8.0)
    assert errors(field, truth)[visible].mean() < 0.08
    assert np.mean(field.confidence[visible] > 0.5) > 0.97


def test_what_leads_out_of_the_image_has_no_confidence(wall):
    H = turned(shift=(60.0, 0.0))
    truth = exact_flow(H).astype(np.float32)
    field = search(wall.picture(), wall.picture(H), truth)
    outside = ~inside(truth, margin=-1.0)
    assert outside.any()
    assert np.mean(field.confidence[outside] > 0.5) < 0.01


def test_images_of_different_places_have_hardly_any_confidence(wall):
    other = Wall(texture(np.random.default_rng(8)))
    confidence = search(wall.picture(), other.picture()).confidence
    assert np.mean(confidence > 0.5) < 0.01


def test_a_plain_image_has_no_confidence():
    plain = np.full((*SIZE, 3), 128, np.uint8)
    assert search(plain, plain).confidence.max() == 0.0


def test_confidence_halves_where_the_way_back_misses_by_a_standard_deviation():
    forward = np.full((*SIZE, 2), (10.0, 0.0), np.float32)
    backward = -forward
    backward[:, WIDTH // 2 :] += 0.0, CONFIG.noise_px
    confidence = forward_backward_consistency(forward, backward, CONFIG)
    np.testing.assert_allclose(confidence[:, : WIDTH // 2 - 11], 1.0)
    np.testing.assert_allclose(confidence[:, WIDTH // 2 :], 0.5)


def test_the_way_back_is_taken_from_where_the_flow_leads():
    H = turned(roll_deg=10.0, zoom=1.1, shift=(20.0, 0.0))
    there, back = (exact_flow(each).astype(np.float32) for each in (H, np.linalg.inv(H)))
    seen = inside(there)
    assert forward_backward_consistency(there, back, CONFIG)[seen].min() > 0.99
    assert np.median(forward_backward_consistency(there, -there, CONFIG)[seen]) < 0.1


@pytest.mark.parametrize(("gain", "offset"), [(1.0, 0.0), (0.5, 90.0), (1.5, -60.0)])
def test_correlation_does_not_depend_on_gain_and_offset(gain, offset):
    image = checks(40)
    changed = (gain * image + offset).astype(np.uint8)
    assert normalised_cross_correlation(image, changed).min() > 0.99


def test_correlation_of_a_negative_is_minus_one():
    image = checks(40)
    assert normalised_cross_correlation(image, 255 - image).max() < -0.99


def test_a_window_without_texture_does_not_correlate():
    image = checks(40)
    image[:, :160] = 90
    correlation = normalised_cross_correlation(image, image)
    assert np.abs(correlation[:, : 160 - PATCH_PX // 2]).max() == 0.0
    assert correlation[:, 160 + PATCH_PX // 2 :].min() > 0.999


def test_noise_that_is_not_shared_gives_little_confidence(rng):
    a, b = (np.clip(rng.normal(128, 3, SIZE), 0, 255).astype(np.uint8) for _ in range(2))
    assert np.maximum(normalised_cross_correlation(a, b), 0.0).mean() < 0.1


def test_a_goal_in_a_part_of_the_view_is_confident_whatever_is_found_in_the_rest(wall):
    """In the rest another wall moves, seen through noise: nothing of it is confident."""
    rest = np.s_[:, WIDTH // 5 :]
    moved, noise = wall.picture(turned(shift=(14.0, 0.0))), texture(np.random.default_rng(9))
    picture = wall.picture()
    picture[rest] = (0.4 * moved + 0.6 * noise[:HEIGHT, :WIDTH])[rest].astype(np.uint8)
    field = search(wall.picture(), picture)
    assert np.mean(field.confidence[rest] > 0.5) < 0.02
    assert np.mean(field.confidence[:, : WIDTH // 5 - 16] > 0.5) > 0.9
