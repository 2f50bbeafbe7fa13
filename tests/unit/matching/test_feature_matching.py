"""SIFT features and the agreement of neighbours."""

import cv2
import numpy as np
import pytest
from textured_wall import HEIGHT, WIDTH, Wall, texture, turned

from dfvs_core.matching.features import detect_features, even_contrast, match_features

SIZE = (HEIGHT, WIDTH)


@pytest.fixture(scope="module")
def wall():
    return Wall(texture(np.random.default_rng(3)))


def grey(picture):
    return cv2.cvtColor(picture, cv2.COLOR_RGB2GRAY)


def miss(matches, H):
    expected = cv2.perspectiveTransform(matches.current[:, None].astype(np.float64), H)[:, 0]
    return np.linalg.norm(expected - matches.other, axis=1)


def test_matches_that_agree_with_their_neighbours_are_right(wall):
    H = turned(roll_deg=30.0, zoom=1.3, shift=(20.0, 10.0))
    a, b = (detect_features(grey(wall.picture(h))) for h in (None, H))
    matches = match_features(a, b, SIZE, ratio=0.9)
    assert len(matches) > 50
    assert np.mean(miss(matches, H) < 3.0) > 0.97


def test_without_a_ratio_test_neighbours_still_sort_out_chance_matches(wall):
    """All mutual neighbours are let in, a third of them by chance: agreement alone decides."""
    H = turned(roll_deg=-40.0, zoom=0.8)
    a, b = (detect_features(grey(wall.picture(h))) for h in (None, H))
    matches = match_features(a, b, SIZE, ratio=1.0)
    assert np.mean(miss(matches, H) < 3.0) > 0.9


def test_pictures_of_different_places_share_almost_no_matches(wall):
    elsewhere = Wall(texture(np.random.default_rng(4)))
    a, b = (detect_features(grey(w.picture())) for w in (wall, elsewhere))
    assert len(match_features(a, b, SIZE, ratio=0.9)) < 8


def test_what_is_a_third_as_large_in_the_other_picture_is_still_found(wall):
    H = turned(roll_deg=20.0, zoom=1 / 3)
    a, b = (detect_features(grey(wall.picture(h))) for h in (None, H))
    matches = match_features(a, b, SIZE, ratio=0.9)
    assert len(matches) > 20
    assert np.mean(miss(matches, H) < 3.0) > 0.9


def test_features_come_from_every_quarter_of_a_picture_with_one_busy_corner(wall):
    picture = grey(wall.picture()).astype(np.float32)
    picture[:120, 160:] = 128 + 0.15 * (picture[:120, 160:] - 128)
    picture[120:] = 128 + 0.15 * (picture[120:] - 128)
    points = detect_features(picture.astype(np.uint8)).points
    quarters = 2 * (points[:, 1] >= 120) + (points[:, 0] >= 160)
    assert np.bincount(quarters.astype(int), minlength=4).min() > 0.1 * len(points)


def test_a_point_on_the_seam_of_two_tiles_is_found_once(wall):
    points = detect_features(grey(wall.picture())).points
    seam = np.abs(points - np.float32([159.5, 119.5])).min(axis=1) < 2.0
    places, counts = np.unique(np.round(points[seam], 1), axis=0, return_counts=True)
    assert len(places) > 10
    # one in five has two orientations
    assert np.mean(counts) < 1.5


def test_a_plain_picture_has_no_features_and_no_matches(wall):
    plain = detect_features(np.full(SIZE, 90, np.uint8))
    textured = detect_features(grey(wall.picture()))
    assert len(plain) == 0
    assert len(match_features(plain, textured, SIZE, ratio=0.9)) == 0
    assert len(match_features(textured, plain, SIZE, ratio=0.9)) == 0


def test_faint_texture_in_the_dark_is_not_lost(wall):
    picture = grey(wall.picture())
    dark = (20 + picture.astype(np.float32) * 0.08).astype(np.uint8)
    assert len(detect_features(dark)) > 0.5 * len(detect_features(picture))
    # 8 % of the contrast went in; the noise floor keeps two thirds of the rest back
    assert even_contrast(dark).std() > 0.25 * even_contrast(picture).std()
