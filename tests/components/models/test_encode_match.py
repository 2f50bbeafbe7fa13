"""Sparse matches of an encode-match bundle, in px of the images that they were found in."""

import math
from types import SimpleNamespace

import cv2
import grid_network
import numpy as np
import pytest
from grid_network import CELL, HEIGHT, WIDTH, centres
from textured_wall import texture

from dfvs_core.errors import ModelError
from dfvs_core.matching.staged import StagedMatcher
from dfvs_models.bundle import read_bundle
from dfvs_models.catalog import bundle_folder
from dfvs_models.encode_match import EncodeMatchPoints
from dfvs_models.onnx_session import Execution

SQUARE = 4
"""Cells along a square image in the middle of the grid network's."""


def load(folder, turns_rad=(0.0,), scales=(1.0,)):
    return EncodeMatchPoints(read_bundle(folder), Execution(threads=1), turns_rad, scales)


def grey(width, height):
    return np.full((height, width, 3), 128, np.uint8)


def match(points, first, second):
    return list(points.hypotheses(points.encode(first), points.encode(second)))


def scaled(points, factor):
    """Points of an image in px of one that is larger by a factor."""
    return (points + 0.5) * factor - 0.5


def test_points_are_in_px_of_images_of_each_ones_own_size_and_shape(tmp_path):
    """Images that fit the network's height, one as large and one twice as large."""
    points = load(grid_network.write_bundle(tmp_path))
    small, large = grey(SQUARE * CELL, HEIGHT), grey(2 * SQUARE * CELL, 2 * HEIGHT)
    expected = centres(SQUARE, HEIGHT // CELL)
    (found,) = match(points, small, large)
    np.testing.assert_allclose(found.current, expected, atol=1e-4)
    np.testing.assert_allclose(found.other, scaled(expected, 2.0), atol=1e-4)
    (found,) = match(points, large, small)
    np.testing.assert_allclose(found.current, scaled(expected, 2.0), atol=1e-4)
    np.testing.assert_allclose(found.other, expected, atol=1e-4)


def test_an_image_wider_than_the_networks_is_fitted_by_its_width(tmp_path):
    points = load(grid_network.write_bundle(tmp_path))
    wide = grey(3 * WIDTH, 3 * 2 * CELL)
    (found,) = match(points, wide, wide)
    np.testing.assert_allclose(found.current, scaled(centres(6, 2), 3.0), atol=1e-4)
    np.testing.assert_allclose(found.other, found.current, atol=1e-4)


def test_partners_in_the_turned_image_are_turned_back(tmp_path):
    angle = math.radians(30.0)
    points = load(grid_network.write_bundle(tmp_path), (0.0, angle))
    upright, turned = match(points, *[grey(2 * WIDTH, 2 * HEIGHT)] * 2)
    np.testing.assert_allclose(upright.other, upright.current, atol=1e-4)
    assert 12 < len(turned) < len(upright)  # its corners are outside
    # turned counter-clockwise in the image, where v points down; back is the other way
    c, s = math.cos(angle), math.sin(angle)
    middle = np.array([2 * WIDTH - 1, 2 * HEIGHT - 1]) / 2
    back = (turned.current - middle) @ np.array([[c, -s], [s, c]]).T + middle
    np.testing.assert_allclose(turned.other, back, atol=1e-3)


@pytest.mark.parametrize(
    ("turn_deg", "scale", "angle_deg", "reduced"),
    [
        (2.0, 1.1, 0.0, 1.0),
        (25.0, 1.0, 45.0, 1.0),
        (-40.0, 1.9, -45.0, 0.5),
        (-358.0, 1.3, 0.0, 1.0),
    ],
)
def test_what_is_known_of_turn_and_scale_chooses_the_change(
    tmp_path, turn_deg, scale, angle_deg, reduced
):
    turns, scales = np.radians([-45.0, 0.0, 45.0]), (1.0, 0.5)
    folder = grid_network.write_bundle(tmp_path)
    image = grey(2 * WIDTH, 2 * HEIGHT)
    points = load(folder, tuple(turns), scales)
    first, second = points.encode(image), points.encode(image)
    found = points.expected(first, second, math.radians(turn_deg), scale)
    (wanted,) = match(load(folder, (math.radians(angle_deg),), (reduced,)), image, image)
    np.testing.assert_array_equal(found.other, wanted.other)


@pytest.mark.parametrize(
    "spoilt",
    [
        {"match": grid_network.match_model(confidence="Sqrt")},
        {"match": grid_network.match_model(confidence="Reciprocal")},
        {"match": grid_network.match_model(confidence="Abs", is_spoilt=True)},
        {
            "encode": grid_network.encode_model(is_spoilt=True),
            "match": grid_network.match_model(confidence="Abs"),
        },
    ],
    ids=["confidence is no number", "confidence is infinite", "partner", "keypoint"],
)
def test_output_that_is_not_finite_gives_no_match(tmp_path, spoilt):
    points = load(grid_network.write_bundle(tmp_path, **spoilt))
    image = grey(WIDTH, HEIGHT)
    image[:, : 2 * CELL] = grid_network.SPOILT_LEVEL // 2
    (found,) = match(points, image, image)
    expected = centres(WIDTH // CELL, HEIGHT // CELL)
    right = expected[expected[:, 0] > 2 * CELL]
    np.testing.assert_allclose(found.current, right, atol=1e-4)
    assert np.isfinite(found.other).all()
    assert np.isfinite(found.confidence).all()


def test_a_bundle_of_another_kind_is_refused(tmp_path):
    graph = {"file": "encode.onnx", "inputs": ["x"], "outputs": ["y"]}
    depth = {"quantity": "depth", "unit": "relative", "spread": 0.2}
    folder = grid_network.write_bundle(tmp_path, kind="mono", graphs={"mono": graph}, depth=depth)
    with pytest.raises(ModelError, match="'encode-match'"):
        load(folder)


SIZE = (360, 200)
"""(width, height) px, of another shape than the network's 4:3."""
ROLL_DEG = 40.0


def test_partners_in_the_reduced_image_are_enlarged_again(tmp_path):
    points = load(grid_network.write_bundle(tmp_path), scales=(0.5,))
    (found,) = match(points, *[grey(WIDTH, HEIGHT)] * 2)
    middle = np.array([WIDTH - 1, HEIGHT - 1]) / 2
    np.testing.assert_allclose(found.other, 2.0 * (found.current - middle) + middle, atol=1e-4)


@pytest.mark.parametrize(
    ("level", "scales", "runs"), [(128, (1.0, 0.5), 3), (255, (1.0, 0.5), 2), (255, (1.0,), 1)]
)
def test_changes_are_ranked_up_to_one_with_clear_support(
    tmp_path, monkeypatch, level, scales, runs
):
    """Whose keypoints are then all matched, for the first hypothesis."""
    points = load(grid_network.write_bundle(tmp_path), scales=scales)
    image = np.full((HEIGHT, WIDTH, 3), level, np.uint8)
    first, second = points.encode(image), points.encode(image)
    run, matched = points._match.run, []
    monkeypatch.setattr(points._match, "run", lambda feeds: matched.append(feeds) or run(feeds))
    found = next(points.hypotheses(first, second))
    assert len(matched) == runs
    np.testing.assert_allclose(found.other, found.current, atol=1e-4)


LARGE = 520


@pytest.fixture(scope="module")
def network():
    turns = (0.0, math.radians(-45.0), math.radians(45.0))
    return load(bundle_folder("dfvs-flow"), turns)


@pytest.fixture(scope="module")
def large():
    return texture(np.random.default_rng(17), LARGE, LARGE).astype(np.uint8)


def view(large, roll_deg):
    """Image of ``SIZE`` from the middle of a large one, which is turned clockwise, and the map."""
    M = cv2.getRotationMatrix2D(((LARGE - 1) / 2, (LARGE - 1) / 2), -roll_deg, 1.0)
    M[:, 2] += (np.array(SIZE) - LARGE) / 2
    return cv2.warpAffine(large, M, SIZE, flags=cv2.INTER_CUBIC), M


@pytest.fixture(scope="module", params=[0.0, -ROLL_DEG, ROLL_DEG])
def turned(request, network, large):
    """An image and itself turned: images, their matches, and where points of the first lie."""
    (first, there), (second, here) = view(large, 0.0), view(large, request.param)
    encoded = [network.encode(image) for image in (first, second)]

    def moved(points):
        return (points - there[:, 2]) @ np.linalg.inv(there[:, :2]).T @ here[:, :2].T + here[:, 2]

    return SimpleNamespace(
        roll_deg=request.param,
        images=(first, second),
        encoded=encoded,
        found=list(network.hypotheses(*encoded)),
        moved=moved,
    )


def test_an_image_is_matched_with_itself_turned_and_the_right_turn_comes_first(turned):
    sure = [matches.select(matches.confidence > 0.5) for matches in turned.found]
    best = sure[0]
    assert len(best) == max(len(matches) for matches in sure)
    assert len(best) > 100
    apart = np.linalg.norm(best.other - turned.moved(best.current), axis=1)
    # keypoints are whole px of the network's image, 0.6 px of these, in each of the two
    assert np.mean(apart < 2.0) > 0.85
    assert np.median(apart) < 1.1


def test_an_encoded_image_is_matched_without_the_encoder(tmp_path, monkeypatch):
    """So that nothing between two frames has to do both."""
    points = load(grid_network.write_bundle(tmp_path))
    first, second = (points.encode(grey(WIDTH, HEIGHT)) for _ in range(2))
    monkeypatch.setattr(points, "keypoints", None)
    assert len(points.expected(first, second, 0.0, 1.0)) > 0


def test_a_few_matches_are_right_where_the_turn_is_known(network, turned):
    found = network.expected(*turned.encoded, math.radians(turned.roll_deg), 1.0)
    apart = np.linalg.norm(found.other - turned.moved(found.current), axis=1)
    assert len(found) <= 400
    sure = found.confidence > 0.5
    assert np.count_nonzero(sure) > 30
    assert np.mean(apart[sure] < 2.0) > 0.8


def test_an_image_is_matched_with_one_from_a_third_of_the_distance(large):
    third = LARGE // 3
    near = cv2.resize(large[third:-third, third:-third], (LARGE, LARGE))
    found = match(load(bundle_folder("dfvs-flow"), scales=(1.0, 0.5)), large, near)
    sure = found[0].select(found[0].confidence > 0.5)
    expected = (sure.current - third) * LARGE / (LARGE - 2 * third)
    assert len(sure) > 28
    assert np.mean(np.linalg.norm(sure.other - expected, axis=1) < 12.0) > 0.8
    _, upright = found
    assert len(sure) > 2 * np.count_nonzero(upright.confidence > 0.5)


def test_matches_lie_in_both_images(turned):
    for matches in turned.found:
        for points in (matches.current, matches.other):
            assert (points > -0.5).all()
            assert (points < np.array(SIZE) - 0.5).all()


@pytest.mark.parametrize("turned", [ROLL_DEG], indirect=True)
def test_the_same_images_give_the_same_bits(network, turned):
    for a, b in zip(turned.found, match(network, *turned.images), strict=True):
        assert a.current.tobytes() == b.current.tobytes()
        assert a.other.tobytes() == b.other.tobytes()
        assert a.confidence.tobytes() == b.confidence.tobytes()


def test_plain_images_give_no_flow(network):
    plain = grey(*SIZE)
    assert all((matches.confidence < 0.5).all() for matches in match(network, plain, plain))
    matcher = StagedMatcher(network)
    field = matcher.match(matcher.encode(plain), matcher.encode(plain))
    assert field.is_finite()
    assert field.confidence.max() == 0.0
