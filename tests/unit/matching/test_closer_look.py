"""Enlarged parts of a picture, and matches by way of them."""

from __future__ import annotations

import math

import cv2
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from textured_wall import Wall, exact_flow, texture, turned

from dfvs_core.correspondence import FlowField
from dfvs_core.matching.classical import ClassicalMatcher
from dfvs_core.matching.closer_look import STAGES, TURNED_STAGES, Part, part_around
from dfvs_core.matching.hybrid import HybridMatcher
from dfvs_core.matching.matcher import Prepared
from dfvs_core.matching.merit import Candidate
from dfvs_core.matching.sureness import nothing, only, sure_share
from dfvs_core.matching.warping import pixel_grid

SIZE = (240, 320)
GRID = pixel_grid(SIZE)

shares = st.floats(0.0, 1.0)
parts = st.builds(Part, st.floats(1.2, 4.0), shares, shares)
turned_parts = st.builds(Part, st.floats(1.0, 4.0), shares, shares, st.floats(-3.2, 3.2))


def places(part: Part) -> np.ndarray:
    """Where the enlarged part's pixels (H, W, 2) are in the picture, by its own words."""
    room = np.array([320, 240]) * (1.0 - 1.0 / part.zoom)
    from_middle = GRID - [159.5, 119.5]
    right = np.array([math.cos(part.turn_rad), math.sin(part.turn_rad)])
    down = np.array([-right[1], right[0]])  # a quarter clockwise from there
    upright = from_middle[..., :1] * right + from_middle[..., 1:] * down + [160.0, 120.0]
    return room * [part.left, part.top] - 0.5 + upright / part.zoom


def shows(part: Part, margin_px: float = 0.0) -> np.ndarray:
    """Which of the part's pixels (H, W) are in the picture, and not at its border."""
    at, last = places(part), np.array([319.0, 239.0])
    return ((at > margin_px) & (at < last - margin_px)).all(axis=-1)


SMOOTH = turned(roll_deg=20.0, zoom=1.3, shift=(15.0, -9.0))


def smooth_flow() -> np.ndarray:
    return exact_flow(SMOOTH).astype(np.float32)


def led_by(H: np.ndarray, at: np.ndarray) -> np.ndarray:
    """Where a homography leads the points (H, W, 2)."""
    return cv2.perspectiveTransform(at.reshape(-1, 1, 2), H).reshape(at.shape)


@given(parts | turned_parts)
def test_a_cut_shows_what_is_there(part: Part) -> None:
    ramp = np.stack([GRID[..., 0] / 2, GRID[..., 1], np.zeros(SIZE)], axis=-1).astype(np.uint8)
    at = places(part)
    miss = part.cut(ramp) - np.stack([at[..., 0] / 2, at[..., 1], np.zeros(SIZE)], axis=-1)
    inner = shows(part, margin_px=1.0)
    assert np.abs(miss[inner]).max() <= 1.1  # whole numbers, and those before were cut off


@given(parts)
def test_a_flow_is_the_same_by_way_of_its_part(part: Part) -> None:
    field = FlowField(smooth_flow(), np.ones(SIZE, np.float32))
    cut, at = part.of(field), places(part)
    assert np.abs(GRID + cut.flow - led_by(SMOOTH, at))[shows(part)].max() < 0.05
    whole = part.whole(cut)
    sure = whole.confidence > 0.9
    miss = np.where(sure, np.abs(whole.flow - field.flow).max(axis=-1), 0.0)
    assert miss[1:-1, 1:-1].max() < 0.05
    assert miss.max() < 0.2  # the picture's border is continued by half an enlarged pixel
    assert sure.mean() == pytest.approx(1.0 / part.zoom**2, abs=0.03)
    assert whole.is_finite()


@given(turned_parts)
def test_a_flow_is_the_same_by_way_of_a_turned_part(part: Part) -> None:
    there = part.inside(SIZE)
    assert (shows(part, margin_px=0.01) <= there).all()
    assert (there <= shows(part, margin_px=-0.01)).all()
    flow = (led_by(SMOOTH, places(part)) - GRID).astype(np.float32)
    whole = part.whole(only(FlowField(flow, np.ones(SIZE, np.float32)), there))
    sure = whole.confidence > 0.99
    miss = np.abs(whole.flow - smooth_flow()).max(axis=-1)
    assert np.max(miss, where=sure, initial=0.0) < 0.05
    assert sure.mean() == pytest.approx(there.mean() / part.zoom**2, abs=0.06)


def test_nothing_is_known_outside_a_part() -> None:
    part = Part(2.0, 1.0, 0.0)
    whole = part.whole(FlowField(smooth_flow(), np.ones(SIZE, np.float32)))
    assert (whole.confidence[:118, 162:] > 0.99).all()
    assert (whole.confidence[122:] == 0.0).all()
    assert (whole.confidence[:, :158] == 0.0).all()


@given(st.integers(0, 300), st.integers(0, 220), st.integers(4, 320), st.integers(4, 240))
def test_the_part_around_what_is_sure_holds_it(left: int, top: int, wide: int, high: int) -> None:
    confidence = np.zeros(SIZE, np.float32)
    confidence[top : top + high, left : left + wide] = 0.9
    field = FlowField(np.zeros((*SIZE, 2), np.float32), confidence)
    part = part_around(field)
    extent = max(min(wide, 320 - left) / 320, min(high, 240 - top) / 240)
    if part is None:
        assert extent > 0.49
        return
    assert 1.5 <= part.zoom <= 3.0
    assert part.of(field).confidence.sum() == pytest.approx(
        part.zoom**2 * confidence.sum(), rel=0.15
    )


def test_there_is_no_part_around_nothing_or_everything() -> None:
    assert part_around(nothing(SIZE)) is None
    assert part_around(FlowField(smooth_flow(), np.ones(SIZE, np.float32))) is None


def test_stray_pixels_do_not_hide_a_part() -> None:
    confidence = np.zeros(SIZE, np.float32)
    confidence[100:160, 200:280] = 1.0
    confidence[10, 10:20] = 1.0
    part = part_around(FlowField(smooth_flow(), confidence))
    assert part is not None
    assert part.zoom > 2.0


class SmallSighted:
    """A network that matches one part of a picture, enlarged, and nothing else."""

    def __init__(self, shown: np.ndarray, flow: np.ndarray) -> None:
        self._shown, self._flow = shown, flow
        self.asked = 0

    def prepare(self, image: np.ndarray) -> Picture:
        return Picture(image)

    def match(
        self, current: Prepared, other: Prepared, guess: FlowField | None = None
    ) -> FlowField:
        self.asked += 1
        assert isinstance(current, Picture)
        knows = np.array_equal(current.image, self._shown)
        return FlowField(self._flow, np.full(SIZE, 0.9 * knows, np.float32))


class Picture(Prepared):
    """A picture as it is."""

    def __init__(self, image: np.ndarray) -> None:
        super().__init__((image.shape[0], image.shape[1]))
        self.image = image


@pytest.fixture(scope="module")
def wall() -> Wall:
    return Wall(texture(np.random.default_rng(4), finest_px=3))


FAR = turned(zoom=3.0, shift=(-150.0, 110.0))
"""What the other picture shows is small in the first one, at the right and up."""


def test_a_goal_that_is_seen_from_afar_is_found_in_a_part(wall, monkeypatch) -> None:
    monkeypatch.setattr("dfvs_core.matching.hybrid.feature_starts", lambda a, b: ())
    a, b = wall.picture(), wall.picture(FAR)
    truth = exact_flow(FAR).astype(np.float32)
    part = min(STAGES[1], key=lambda part: np.abs(led_by(FAR, places(part)) - GRID).max())
    known = part.of(FlowField(truth, np.ones(SIZE, np.float32))).flow
    network = SmallSighted(part.cut(a), known + np.float32(2.0))
    matcher = HybridMatcher(network, judges=True)
    field = matcher.match(matcher.prepare(a), matcher.prepare(b))
    sure = field.confidence > 0.5
    assert sure.mean() > 0.04
    assert np.median(np.linalg.norm(field.flow - truth, axis=-1)[sure]) < 0.5
    assert network.asked > len(STAGES[0]) + len(STAGES[1])


def test_what_a_closer_look_refines_to_what_is_known_to_be_wrong_has_no_merit(wall) -> None:
    a, b = wall.picture(), wall.picture(FAR)
    truth = FlowField(exact_flow(FAR).astype(np.float32), np.ones(SIZE, np.float32))
    part = min(STAGES[1], key=lambda part: np.abs(led_by(FAR, places(part)) - GRID).max())
    network = SmallSighted(part.cut(a), part.of(truth).flow + np.float32(2.5))  # 3.5 px off
    matcher = HybridMatcher(network, judges=True)
    current, other = matcher.prepare(a), matcher.prepare(b)
    (found,) = matcher._look_closer(current, other, STAGES, ())
    (passed_over,) = matcher._look_closer(current, other, STAGES, [truth])
    assert found.merit > 0.01
    assert passed_over.merit < 0.1 * found.merit


ROLLED = turned(roll_deg=45.0, zoom=2.0)
"""The same, of a camera that was rolled besides."""


@pytest.mark.parametrize("any_roll", [True, False])
def test_a_rolled_view_is_found_in_a_turned_part_where_that_is_asked_for(
    wall, monkeypatch, any_roll
) -> None:
    monkeypatch.setattr("dfvs_core.matching.hybrid.feature_starts", lambda a, b: ())
    a, b = wall.picture(), wall.picture(ROLLED)
    truth = exact_flow(ROLLED).astype(np.float32)

    def miss(part: Part) -> float:
        return float(np.abs(led_by(ROLLED, places(part)) - GRID).max())

    part = min(TURNED_STAGES[0], key=miss)
    known = (led_by(ROLLED, places(part)) - GRID).astype(np.float32)
    network = SmallSighted(part.cut(a), known + np.float32(2.0))
    matcher = HybridMatcher(network, judges=True, any_roll=any_roll)
    field = matcher.match(matcher.prepare(a), matcher.prepare(b))
    sure = field.confidence > 0.5
    if not any_roll:
        assert not sure.any()
        return
    assert sure.mean() > 0.1
    assert np.median(np.linalg.norm(field.flow - truth, axis=-1)[sure]) < 0.5


def test_what_the_whole_picture_shows_adds_to_a_part_that_agrees(wall, monkeypatch) -> None:
    truth = exact_flow(FAR).astype(np.float32)
    left, right = np.zeros((2, *SIZE), np.float32)
    left[:, :170], right[:, 150:] = 0.9, 0.8
    found, part = (FlowField(truth, sure) for sure in (left, right))
    monkeypatch.setattr("dfvs_core.matching.hybrid.feature_starts", lambda a, b: ())
    monkeypatch.setattr("dfvs_core.matching.hybrid._DOUBTFUL_MERIT", 1.0)
    monkeypatch.setattr(HybridMatcher, "_look_closer", lambda *_: [Candidate(part, 1.0)])
    matcher = HybridMatcher(SmallSighted(np.zeros(0), truth), judges=True)
    a, b = (matcher.prepare(wall.picture(H)) for H in (None, FAR))
    assert sure_share(matcher._bridge(a, b, found, ())) == 1.0


def test_nothing_is_looked_at_closer_where_much_was_found(wall) -> None:
    a, b = wall.picture(), wall.picture(turned(roll_deg=25.0, shift=(20.0, 10.0)))
    network = SmallSighted(np.zeros(0), np.zeros((*SIZE, 2), np.float32))
    matcher = HybridMatcher(network, judges=True)
    field = matcher.match(matcher.prepare(a), matcher.prepare(b))
    assert sure_share(field) > 0.3
    assert network.asked < len(STAGES[0])


def test_parts_without_texture_are_not_looked_at() -> None:
    plain = np.full((*SIZE, 3), 90, np.uint8)
    network = SmallSighted(plain, np.zeros((*SIZE, 2), np.float32))
    matcher = HybridMatcher(network, judges=True)
    other = plain.copy()
    other[:] = 200
    matcher.match(matcher.prepare(plain), matcher.prepare(other))
    assert network.asked < len(STAGES[0])


def test_what_is_small_is_tracked_in_its_part(wall) -> None:
    a, b = wall.picture(), wall.picture(FAR)
    truth = exact_flow(FAR).astype(np.float32)
    at = GRID + truth
    seen = (at > 4.0).all(axis=-1) & (at < np.array([316.0, 236.0])).all(axis=-1)
    assert seen.mean() < 0.11
    guess = FlowField(truth + np.float32(3.0), seen.astype(np.float32))
    matcher = ClassicalMatcher()
    field = matcher.track(matcher.prepare(a), matcher.prepare(b), guess)
    assert field is not None
    sure = field.confidence > 0.5
    assert np.mean(sure[seen]) > 0.5
    assert np.median(np.linalg.norm(field.flow - truth, axis=-1)[sure]) < 0.3
