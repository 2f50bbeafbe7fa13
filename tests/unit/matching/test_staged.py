"""The staged matcher around a scripted point matcher: sizes, features, and refusals."""

from functools import partial

import cv2
import numpy as np
import pytest
from textured_wall import HEIGHT, WIDTH, Wall, errors, exact_flow, inside, texture, turned

from dfvs_core.errors import ImageError
from dfvs_core.matching.correspondence import FlowField, empty_flow
from dfvs_core.matching.matcher import ImageFeatures
from dfvs_core.matching.points import PointMatches
from dfvs_core.matching.staged import StagedMatcher
from dfvs_core.matching.warping import resized

MOTION = turned(roll_deg=20.0, zoom=1.1, shift=(20.0, -10.0))
TRUTH = exact_flow(MOTION)


class KnownPoints:
    """Point matcher that knows the motion, and notes the size of each image it encodes.

    Its points lie in images of ``width_px``, as a network's do.
    """

    def __init__(self, width_px):
        self.width_px = width_px
        self.encoded = []

    def encode(self, image):
        self.encoded.append(image.shape)
        return image.shape[1] / WIDTH

    def hypotheses(self, current, other, exclusion=None):
        yield self.expected(current, other, 0.0, 1.0)

    def expected(self, current, other, turn_rad, scale):
        v, u = np.mgrid[8:HEIGHT:12, 8:WIDTH:12].reshape(2, -1)
        kept = inside(TRUTH)[v, u]
        at = np.stack([u, v], axis=1)[kept].astype(float)
        to = at + TRUTH[v, u][kept]
        at, to = ((each + 0.5) * current - 0.5 for each in (at, to))
        return PointMatches(
            at.astype(np.float32), to.astype(np.float32), np.ones(len(at), np.float32)
        )


@pytest.fixture(scope="module")
def pictures():
    """Of twice the size in which the motion is given."""
    wall = Wall(texture(np.random.default_rng(7)))
    return [cv2.resize(wall.picture(H), (2 * WIDTH, 2 * HEIGHT)) for H in (None, MOTION)]


@pytest.mark.parametrize(
    ("size", "working_size"),
    [
        ((480, 640), (240, 320)),
        ((240, 320), (240, 320)),
        ((720, 1280), (208, 370)),
        ((120, 160), (120, 160)),
    ],
)
def test_the_working_size_has_at_most_as_many_pixels_as_320_x_240(size, working_size):
    """A smaller image is not enlarged."""
    image = np.zeros((*size, 3), np.uint8)
    prepared = StagedMatcher(KnownPoints(640)).encode(image)
    assert prepared.size == working_size
    assert prepared.grey.shape == working_size


@pytest.mark.parametrize("width_px", [160, 320, 640, 1000])
def test_flow_is_at_the_working_size_whichever_the_points_are_found_at(pictures, width_px):
    points = KnownPoints(width_px)
    matcher = StagedMatcher(points)
    current, other = map(matcher.encode, pictures)
    field = matcher.match(current, other)
    assert points.encoded == 2 * [(min(width_px, 640) * 3 // 4, min(width_px, 640), 3)]
    assert field.flow.shape == (HEIGHT, WIDTH, 2)
    visible = inside(TRUTH, margin=8.0)
    assert np.mean(errors(field, TRUTH)[visible] < 0.5) > 0.97
    for again in (matcher.track, matcher.extend):
        found = again(current, other, field)
        assert np.mean(errors(found, TRUTH)[visible] < 0.5) > 0.97


def test_the_dense_search_sees_more_than_the_images_that_smaller_features_are_found_in(pictures):
    grey = cv2.cvtColor(pictures[0], cv2.COLOR_RGB2GRAY)
    prepared = StagedMatcher(KnownPoints(160)).encode(pictures[0])
    np.testing.assert_array_equal(prepared.grey, resized(grey, (HEIGHT, WIDTH)))


def test_features_are_encoded_once_and_for_relocalisation_only(pictures):
    points = KnownPoints(320)
    matcher = StagedMatcher(points)
    current, other = map(matcher.encode, pictures)
    predicted = FlowField(TRUTH.astype(np.float32), np.ones((HEIGHT, WIDTH), np.float32))
    assert matcher.track(current, other, predicted) is not None
    assert points.encoded == []
    first = matcher.match(current, other)
    second = matcher.match(current, other)
    assert len(points.encoded) == 2
    assert first.flow.tobytes() == second.flow.tobytes()


def test_released_features_are_encoded_anew_and_match_alike(pictures):
    points = KnownPoints(320)
    matcher = StagedMatcher(points)
    current, other = map(matcher.encode, pictures)
    first = matcher.match(current, other)
    current.release()
    current.release()
    assert current._features is None
    assert matcher.match(current, other).flow.tobytes() == first.flow.tobytes()
    assert len(points.encoded) == 3


def test_an_image_of_another_matcher_is_refused(pictures):
    matcher = StagedMatcher(KnownPoints(320))
    mine, foreign = matcher.encode(pictures[0]), ImageFeatures((HEIGHT, WIDTH))
    nothing = empty_flow((HEIGHT, WIDTH))
    for pair in ((mine, foreign), (foreign, mine)):
        for attempt in (
            partial(matcher.match, *pair),
            partial(matcher.track, *pair, nothing),
            partial(matcher.extend, *pair, nothing),
        ):
            with pytest.raises(ImageError, match="another matcher"):
                attempt()


def test_images_of_different_working_sizes_are_refused(pictures):
    matcher = StagedMatcher(KnownPoints(320))
    low = np.ascontiguousarray(pictures[1][:240])
    with pytest.raises(ImageError, match="320 x 240 and 453 x 170"):
        matcher.match(matcher.encode(pictures[0]), matcher.encode(low))


@pytest.mark.parametrize(
    "image",
    [
        np.zeros((240, 320), np.uint8),
        np.zeros((240, 320, 4), np.uint8),
        np.zeros((240, 320, 3), np.float32),
        np.zeros((16, 320, 3), np.uint8),
    ],
    ids=["grey", "four channels", "floats", "too small"],
)
def test_what_is_no_rgb_image_is_refused(image):
    with pytest.raises(ImageError):
        StagedMatcher(KnownPoints(320)).encode(image)
