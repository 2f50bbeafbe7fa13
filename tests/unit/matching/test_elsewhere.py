"""Another match than a given one: repeated structures have one, all else has none."""

import numpy as np
import pytest
from repeated_shelves import PERIOD_PX, shelves
from textured_wall import Wall, texture

from dfvs_core.matching.config import MatchingConfig
from dfvs_core.matching.correspondence import FlowField
from dfvs_core.matching.elsewhere import SiftImage, match_elsewhere

STILL = FlowField(np.zeros((240, 320, 2), np.float32), np.ones((240, 320), np.float32))


def elsewhere(view, goal, flow=STILL):
    config = MatchingConfig()
    return match_elsewhere(*(SiftImage(image, config) for image in (view, goal)), flow, config)


@pytest.mark.parametrize(("marks", "shift"), [((2, 3, 4, 5), 1), ((0, 1, 2, 3), -1)])
def test_shelves_one_aside_match_as_their_marks_do(marks, shift):
    found = elsewhere(shelves(*marks), shelves(1, 2, 3, 4))
    assert found is not None
    sure = found.flow[found.confidence > 0.5]
    assert np.median(sure, axis=0) == pytest.approx([shift * PERIOD_PX, 0.0], abs=0.5)


def test_what_follows_the_given_flow_is_not_confident():
    found = elsewhere(shelves(2, 3, 4, 5), shelves(1, 2, 3, 4))
    assert np.linalg.norm(found.flow[found.confidence > 0.0], axis=1).min() >= 3.0


def test_what_is_there_once_has_no_other_match():
    wall = Wall(texture(np.random.default_rng(1))).picture()
    assert elsewhere(wall, wall) is None


def test_a_thing_that_was_moved_is_no_other_match():
    goal = Wall(texture(np.random.default_rng(1))).picture()
    view, thing = goal.copy(), texture(np.random.default_rng(2))[:90, :90]
    goal[60:150, 30:120], view[90:180, 190:280] = thing, thing
    assert elsewhere(view, goal) is None


@pytest.mark.parametrize("value", [0, 255])
def test_a_plain_image_has_no_other_match(value):
    plain = np.full((240, 320, 3), value, np.uint8)
    assert elsewhere(plain, shelves(1, 2, 3, 4)) is None
    assert elsewhere(shelves(1, 2, 3, 4), plain) is None
