"""SIFT features and the agreement of neighbours."""

import cv2
import numpy as np
import pytest
from textured_wall import HEIGHT, WIDTH, Wall, texture, turned

from dfvs_core.matching.features import FeatureMatcher, detect_features, even_contrast

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
    matches = FeatureMatcher(a, b, SIZE).match(ratio=0.9)
    assert len(matches) > 50
    assert np.mean(miss(matches, H) < 3.0) > 0.97


def test_without_a_ratio_test_neighbours_still_sort_out_chance_matches(wall):
    """All mutual neighbours are let in, a third of them by chance: agreement alone decides."""
    H = turned(roll_deg=-40.0, zoom=0.8)
    a, b = (detect_features(grey(wall.picture(h))) for h in (None, H))
    matches = FeatureMatcher(a, b, SIZE).match(ratio=1.0)
    assert np.mean(miss(matches, H) < 3.0) > 0.9


def test_pictures_of_different_places_share_almost_no_matches(wall):
    elsewhere = Wall(texture(np.random.default_rng(4)))
    a, b = (detect_features(grey(w.picture())) for w in (wall, elsewhere))
    assert len(FeatureMatcher(a, b, SIZE).match(ratio=0.9)) < 8


def test_repeated_texture_is_matched_where_it_is_expected():
    """A tiled wall: every tile looks like every other, only the prediction tells them apart."""
    tile = texture(np.random.default_rng(5), 40, 40)
    tiled = np.tile(tile, (20, 22, 1))
    a = grey(tiled[200:440, 200:520].astype(np.uint8))
    b = grey(tiled[207:447, 195:515].astype(np.uint8))
    features = detect_features(a), detect_features(b)
    matcher = FeatureMatcher(*features, SIZE)
    predicted = features[0].points + np.float32([5.0, -7.0])
    near = matcher.match_near(predicted, within_px=15.0, ratio=0.9)
    assert len(near) > 3 * len(matcher.match(ratio=0.9))
    assert np.mean(miss(near, turned(shift=(5.0, -7.0))) < 1.0) > 0.95


def test_a_plain_picture_has_no_features_and_no_matches(wall):
    plain = detect_features(np.full(SIZE, 90, np.uint8))
    textured = detect_features(grey(wall.picture()))
    assert len(plain) == 0
    assert len(FeatureMatcher(plain, textured, SIZE).match(ratio=0.9)) == 0
    assert len(FeatureMatcher(textured, plain, SIZE).match(ratio=0.9)) == 0


def test_faint_texture_in_the_dark_is_not_lost(wall):
    picture = grey(wall.picture())
    dark = (20 + picture.astype(np.float32) * 0.08).astype(np.uint8)
    assert len(detect_features(dark)) > 0.5 * len(detect_features(picture))
    # 8 % of the contrast went in; the noise floor keeps two thirds of the rest back
    assert even_contrast(dark).std() > 0.25 * even_contrast(picture).std()
