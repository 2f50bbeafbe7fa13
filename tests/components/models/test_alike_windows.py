"""Two windows that are alike, and a goal picture of one: which is matched, and which next."""

import numpy as np
import pytest
from textured_wall import HEIGHT, WIDTH, Wall, texture

from dfvs_core.matching.correspondence import FlowField, confident_ratio
from dfvs_models.catalog import load_matcher

ROWS = slice(70, 170)
LEFT, MIDDLE, RIGHT = slice(20, 130), slice(105, 215), slice(190, 300)


@pytest.fixture(scope="module")
def pictures():
    """What the camera sees, with two windows, and the goal, with one in the middle."""
    window = Wall(texture(np.random.default_rng(31))).picture()[ROWS, MIDDLE]
    views = [np.full((HEIGHT, WIDTH, 3), grey, np.uint8) for grey in (110, 120)]
    for columns in (LEFT, RIGHT):
        views[0][ROWS, columns] = window
    views[1][ROWS, MIDDLE] = window
    return views


def moved_by(shift_px):
    """Flow of everything to the side, as the place of a window predicts it."""
    flow = np.full((HEIGHT, WIDTH, 2), (shift_px, 0.0), np.float32)
    return FlowField(flow, np.full((HEIGHT, WIDTH), 0.5, np.float32))


@pytest.mark.parametrize("name", ["classical", "dfvs-flow"])
def test_the_window_that_is_known_to_be_wrong_is_excluded(name, pictures):
    matcher = load_matcher(name, threads=1)
    current, goal = (matcher.encode(view) for view in pictures)

    def matched(excluded):
        field = matcher.match(current, goal, excluded=excluded)
        sure = field.confidence > 0.5
        return field, [float(sure[ROWS, columns].mean()) for columns in (LEFT, RIGHT)]

    _, shares = matched([])
    assert max(shares) > 0.8
    found = int(np.argmax(shares))
    shifts = (85.0, -85.0)
    wrong, right = (moved_by(shifts[k]) for k in (found, 1 - found))
    second, others = matched([wrong])
    assert others[1 - found] > 0.8
    assert others[found] < 0.05
    sure = second.confidence > 0.5
    assert np.median(second.flow[sure] - right.flow[sure], axis=0) == pytest.approx(0.0, abs=0.5)
    third, _ = matched([wrong, right])
    assert confident_ratio(third) < 0.03
