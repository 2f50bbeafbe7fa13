"""A network whose flow is refined: who is asked when, and whose flow is taken."""

from __future__ import annotations

import numpy as np
import pytest
from textured_wall import Wall, exact_flow, texture, turned

from dfvs_core.correspondence import FlowField
from dfvs_core.errors import ImageError
from dfvs_core.matching.classical import ClassicalMatcher
from dfvs_core.matching.hybrid import HybridMatcher
from dfvs_core.matching.matcher import Prepared, follow

SIZE = (240, 320)


class Oracle:
    """A matcher that says what it was told to, there and back, and counts how often it is asked.

    It knows the way back by the order of its pictures: the first one prepared is the current one.
    The third is the other one warped: to that it says ``left``, if it was told anything to say.
    """

    def __init__(
        self,
        there: np.ndarray,
        back: np.ndarray,
        confidence: float | np.ndarray,
        left: np.ndarray | None = None,
    ) -> None:
        sure = np.full(SIZE, confidence, np.float32)
        self.there, self.back = FlowField(there, sure), FlowField(back, sure)
        self.left = self.there if left is None else FlowField(left, np.ones(SIZE, np.float32))
        self.pictures: list[Prepared] = []
        self.asked = 0

    def prepare(self, image: np.ndarray) -> Prepared:
        self.pictures.append(Prepared(image.shape[:2]))
        return self.pictures[-1]

    def match(self, current: Prepared, other: Prepared, guess: FlowField | None = None):
        self.asked += 1
        if len(self.pictures) == 3:
            return self.left
        return self.there if current is self.pictures[0] else self.back


@pytest.fixture(scope="module")
def wall():
    return Wall(texture(np.random.default_rng(11), finest_px=6))


def constant_flow(u: float, v: float) -> np.ndarray:
    return np.full((*SIZE, 2), (u, v), np.float32)


def not_needed(current, other):
    """Stands for the features where nobody may ask for them."""
    pytest.fail("features were asked for")
    yield


def match(matcher, a, b):
    return matcher.match(matcher.prepare(a), matcher.prepare(b))


def test_the_network_is_not_run_where_little_moved(wall) -> None:
    a, b = wall.picture(), wall.picture(turned(roll_deg=1.0, shift=(3.0, -2.0)))
    oracle = Oracle(constant_flow(0.0, 0.0), constant_flow(0.0, 0.0), 1.0)
    field = match(HybridMatcher(oracle, judges=True), a, b)
    assert oracle.asked == len(oracle.pictures) == 0
    classical = match(ClassicalMatcher(), a, b)
    kept = np.linalg.norm(field.flow - classical.flow, axis=-1)[classical.confidence > 0.5]
    assert np.mean(kept < 0.5) > 0.99


def test_the_network_is_not_run_where_the_flow_of_the_frame_before_holds(wall) -> None:
    H = turned(roll_deg=25.0, shift=(20.0, 10.0))
    guess = FlowField(exact_flow(H).astype(np.float32), np.ones(SIZE, np.float32))
    oracle = Oracle(constant_flow(0.0, 0.0), constant_flow(0.0, 0.0), 1.0)
    matcher = HybridMatcher(oracle, judges=True)
    current, other = matcher.prepare(wall.picture()), matcher.prepare(wall.picture(H))
    field = follow(matcher, current, other, guess)
    assert oracle.asked == 0
    assert np.mean(field.confidence > 0.5) > 0.4


def test_a_network_that_judges_itself_is_not_asked_for_the_way_back(wall) -> None:
    plain = np.full((*SIZE, 3), 90, np.uint8)
    oracle = Oracle(constant_flow(12.0, -5.0), constant_flow(30.0, 5.0), 1.0)
    field = match(HybridMatcher(oracle, judges=True), plain, plain)
    assert oracle.asked == 2  # once more with the picture warped
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
    monkeypatch.setattr("dfvs_core.matching.hybrid.feature_starts", lambda a, b: ())
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


def test_the_network_looks_again_at_what_is_left_of_the_motion(wall, monkeypatch) -> None:
    """It sees the left half's motion first; the right half moves by another one."""
    monkeypatch.setattr("dfvs_core.matching.hybrid.feature_starts", not_needed)
    a = wall.picture()
    near, far = wall.picture(turned(shift=(24.0, 0.0))), wall.picture(turned(shift=(-16.0, 30.0)))
    on_left = np.broadcast_to(np.arange(SIZE[1]) < 160, SIZE)
    b = np.where(on_left[..., None], near, far)
    truth = np.where(on_left[..., None], constant_flow(24.0, 0.0), constant_flow(-16.0, 30.0))
    left = truth - constant_flow(24.0, 0.0)
    once = Oracle(constant_flow(24.0, 0.0), truth, 0.9 * on_left, constant_flow(0.0, 0.0))
    twice = Oracle(constant_flow(24.0, 0.0), truth, 0.9 * on_left, left)
    right = np.s_[40:200, 220:300]
    with monkeypatch.context() as features:
        features.setattr("dfvs_core.matching.hybrid.feature_starts", lambda a, b: ())
        blind = match(HybridMatcher(once, judges=True), a, b)
    field = match(HybridMatcher(twice, judges=True), a, b)
    assert twice.asked == 2
    assert np.mean(blind.confidence[right] > 0.5) < 0.1
    assert np.mean(field.confidence[right] > 0.5) > 0.6
    error = np.linalg.norm(field.flow - truth, axis=-1)[right]
    assert np.median(error) < 0.5


def test_a_frame_that_follows_another_does_not_wait_for_features(wall, monkeypatch) -> None:
    """In flight a late result is worse than none: the gate holds after a quarter of a second."""
    calls = []
    monkeypatch.setattr(
        "dfvs_core.matching.hybrid.feature_starts", lambda a, b: calls.append(1) or ()
    )
    nothing = constant_flow(0.0, 0.0)
    oracle = Oracle(there=nothing, back=nothing, confidence=0.0)
    matcher = HybridMatcher(oracle, judges=True)
    other = wall.picture(turned(roll_deg=40.0, shift=(60.0, 50.0)))
    current, other = matcher.prepare(wall.picture()), matcher.prepare(other)
    guess = FlowField(constant_flow(90.0, -80.0), np.ones(SIZE, np.float32))
    field = matcher.match(current, other, guess)
    assert calls == []
    assert field.confidence.max() <= 0.5
    matcher.match(current, other)
    assert calls == [1]


def test_the_network_looks_where_a_guess_points_when_the_guess_has_fallen_behind(
    wall, monkeypatch
) -> None:
    """The camera jumped: the flow of the frame before is off by more than can be searched."""
    monkeypatch.setattr("dfvs_core.matching.hybrid.feature_starts", not_needed)
    H, jump = turned(roll_deg=25.0, shift=(20.0, 10.0)), constant_flow(75.0, -60.0)
    truth = exact_flow(H).astype(np.float32)
    guess = FlowField(truth - jump, np.ones(SIZE, np.float32))
    # the picture warped by the guess is the first one prepared, so "back" is said of it
    oracle = Oracle(there=constant_flow(0.0, 0.0), back=jump + np.float32(0.5), confidence=0.9)
    matcher = HybridMatcher(oracle, judges=True)
    current, other = matcher.prepare(wall.picture()), matcher.prepare(wall.picture(H))
    assert matcher.track(current, other, guess) is None
    field = matcher.match(current, other, guess)
    assert oracle.asked == 1
    error = np.linalg.norm(field.flow - truth, axis=-1)[field.confidence > 0.5]
    assert len(error) > 0.2 * field.confidence.size
    assert np.median(error) < 0.5


def test_a_guess_of_another_size_is_not_used(wall) -> None:
    H = turned(roll_deg=25.0, shift=(20.0, 10.0))
    guess = FlowField(np.zeros((120, 160, 2), np.float32), np.ones((120, 160), np.float32))
    oracle = Oracle(exact_flow(H).astype(np.float32), constant_flow(0.0, 0.0), 0.9)
    matcher = HybridMatcher(oracle, judges=True)
    field = matcher.match(matcher.prepare(wall.picture()), matcher.prepare(wall.picture(H)), guess)
    assert oracle.asked == 1
    assert np.mean(field.confidence > 0.5) > 0.2


def test_a_wrong_network_does_not_displace_a_better_classical_result(wall) -> None:
    a, b = wall.picture(), wall.picture(turned(roll_deg=25.0, shift=(20.0, 10.0)))
    oracle = Oracle(constant_flow(-80.0, 60.0), constant_flow(80.0, -60.0), 1.0)
    field = match(HybridMatcher(oracle, judges=False), a, b)
    assert oracle.asked == 6  # there and back, and again with the picture warped, both times
    classical = match(ClassicalMatcher(), a, b)
    kept = np.linalg.norm(field.flow - classical.flow, axis=-1)[classical.confidence > 0.5]
    assert np.mean(kept < 0.5) > 0.99


def test_pictures_prepared_by_another_matcher_are_refused(wall) -> None:
    picture = wall.picture()
    hybrid = HybridMatcher(Oracle(constant_flow(0.0, 0.0), constant_flow(0.0, 0.0), 1.0), True)
    with pytest.raises(ImageError, match="another matcher"):
        hybrid.match(hybrid.prepare(picture), ClassicalMatcher().prepare(picture))


def test_a_slim_picture_holds_no_features_and_finds_the_same_again(wall) -> None:
    oracle = Oracle(constant_flow(0.0, 0.0), constant_flow(0.0, 0.0), 0.9)
    picture = HybridMatcher(oracle, judges=True).prepare(wall.picture())
    network, found = picture.features, picture.classical.features
    picture.slim()
    assert {"features"}.isdisjoint(vars(picture) | vars(picture.classical))
    assert picture.features is not network
    again = picture.classical.features
    np.testing.assert_array_equal(again.points, found.points)
    np.testing.assert_array_equal(again.descriptors, found.descriptors)
    assert len(oracle.pictures) == 2
