"""A network whose flow is refined: who is asked when, and whose flow is taken."""

from __future__ import annotations

import numpy as np
import pytest
from textured_wall import Wall, exact_flow, texture, turned

from dfvs_core.correspondence import FlowField
from dfvs_core.errors import ImageError
from dfvs_core.matching.classical import ClassicalMatcher
from dfvs_core.matching.hybrid import HybridMatcher
from dfvs_core.matching.matcher import Prepared

SIZE = (240, 320)


class Oracle:
    """A matcher that says what it was told to, there and back, and counts how often it is asked.

    It knows the way back by the order of its pictures: the first one prepared is the current one.
    """

    def __init__(self, there: np.ndarray, back: np.ndarray, confidence: float) -> None:
        sure = np.full(SIZE, confidence, np.float32)
        self.there, self.back = FlowField(there, sure), FlowField(back, sure)
        self.pictures: list[Prepared] = []
        self.asked = 0

    def prepare(self, image: np.ndarray) -> Prepared:
        self.pictures.append(Prepared(image.shape[:2]))
        return self.pictures[-1]

    def match(self, current: Prepared, other: Prepared, guess: FlowField | None = None):
        self.asked += 1
        return self.there if current is self.pictures[0] else self.back


@pytest.fixture(scope="module")
def wall():
    return Wall(texture(np.random.default_rng(11), finest_px=6))


def constant_flow(u: float, v: float) -> np.ndarray:
    return np.full((*SIZE, 2), (u, v), np.float32)


def match(matcher, a, b):
    return matcher.match(matcher.prepare(a), matcher.prepare(b))


def test_the_network_is_not_run_where_little_moved(wall) -> None:
    a, b = wall.picture(), wall.picture(turned(roll_deg=1.0, shift=(3.0, -2.0)))
    oracle = Oracle(constant_flow(0.0, 0.0), constant_flow(0.0, 0.0), 1.0)
    field = match(HybridMatcher(oracle, judges=True), a, b)
    assert oracle.asked == len(oracle.pictures) == 0
    np.testing.assert_array_equal(field.flow, match(ClassicalMatcher(), a, b).flow)


def test_the_network_is_not_run_where_the_flow_of_the_frame_before_holds(wall) -> None:
    H = turned(roll_deg=25.0, shift=(20.0, 10.0))
    guess = FlowField(exact_flow(H).astype(np.float32), np.ones(SIZE, np.float32))
    oracle = Oracle(constant_flow(0.0, 0.0), constant_flow(0.0, 0.0), 1.0)
    matcher = HybridMatcher(oracle, judges=True)
    field = matcher.match(matcher.prepare(wall.picture()), matcher.prepare(wall.picture(H)), guess)
    assert oracle.asked == 0
    assert np.mean(field.confidence > 0.5) > 0.4


def test_a_network_that_judges_itself_is_not_asked_for_the_way_back(wall) -> None:
    plain = np.full((*SIZE, 3), 90, np.uint8)
    oracle = Oracle(constant_flow(12.0, -5.0), constant_flow(30.0, 5.0), 1.0)
    field = match(HybridMatcher(oracle, judges=True), plain, plain)
    assert oracle.asked == 1
    assert field.confidence[120, 160] == pytest.approx(0.5)


def test_on_plain_pictures_the_networks_own_flow_is_the_answer_but_never_sure() -> None:
    plain = np.full((*SIZE, 3), 90, np.uint8)
    oracle = Oracle(constant_flow(12.0, -5.0), constant_flow(-12.0, 5.0), 1.0)
    field = match(HybridMatcher(oracle, judges=False), plain, plain)
    np.testing.assert_array_equal(field.flow, constant_flow(12.0, -5.0))
    assert field.confidence[120, 160] == pytest.approx(0.5)
    assert not (field.confidence > 0.5).any()
    assert field.confidence[120, 315] == 0.0  # leads out of the picture


def test_a_network_that_does_not_find_the_way_back_is_not_trusted() -> None:
    plain = np.full((*SIZE, 3), 90, np.uint8)
    oracle = Oracle(constant_flow(12.0, -5.0), constant_flow(30.0, 5.0), 1.0)
    field = match(HybridMatcher(oracle, judges=False), plain, plain)
    assert field.confidence.max() < 0.01


def test_a_networks_coarse_flow_is_refined_where_features_fail(wall, monkeypatch) -> None:
    """As on repeated texture: no features, but enough texture to refine a good start."""
    monkeypatch.setattr("dfvs_core.matching.classical._motion_from_features", lambda a, b: None)
    H = turned(roll_deg=25.0, shift=(20.0, 10.0))
    a, b = wall.picture(), wall.picture(H)
    truth = exact_flow(H).astype(np.float32)
    way_back = exact_flow(np.linalg.inv(H)).astype(np.float32)
    oracle = Oracle(truth + np.float32(0.7), way_back, 0.9)
    field = match(HybridMatcher(oracle, judges=False), a, b)
    error = np.linalg.norm(field.flow - truth, axis=-1)[field.confidence > 0.5]
    assert len(error) > 0.2 * field.confidence.size
    # the network was off by 1 px
    assert np.median(error) < 0.5


def test_a_wrong_network_does_not_displace_a_better_classical_result(wall) -> None:
    a, b = wall.picture(), wall.picture(turned(roll_deg=25.0, shift=(20.0, 10.0)))
    oracle = Oracle(constant_flow(-80.0, 60.0), constant_flow(80.0, -60.0), 1.0)
    field = match(HybridMatcher(oracle, judges=False), a, b)
    assert oracle.asked == 2  # there and back
    np.testing.assert_array_equal(field.flow, match(ClassicalMatcher(), a, b).flow)


def test_pictures_prepared_by_another_matcher_are_refused(wall) -> None:
    picture = wall.picture()
    hybrid = HybridMatcher(Oracle(constant_flow(0.0, 0.0), constant_flow(0.0, 0.0), 1.0), True)
    with pytest.raises(ImageError, match="another matcher"):
        hybrid.match(hybrid.prepare(picture), ClassicalMatcher().prepare(picture))
