"""Whether red and blue are exchanged shows in points that correspond."""

import numpy as np
import pytest
from still_pipeline import pipeline
from textured_wall import Wall, exact_flow, inside, texture, turned

from dfvs_core.matching.correspondence import FlowField
from dfvs_core.messages.frame import Frame
from dfvs_core.perception.channel_order import is_channel_order_swapped
from dfvs_core.perception.vehicle_history import Motion

H = turned(roll_deg=8.0, zoom=1.1, shift=(20.0, -12.0))


@pytest.fixture
def pair(rng):
    """Picture, goal and the exact flow between them."""
    wall = Wall(texture(rng))
    flow = exact_flow(H)
    confidence = inside(flow).astype(np.float32)
    return wall.picture(), wall.picture(H), FlowField(flow.astype(np.float32), confidence)


def grey(image):
    return np.repeat(image.mean(axis=2, keepdims=True), 3, axis=2).astype(np.uint8)


def test_the_right_order_passes_and_the_wrong_one_does_not(pair):
    image, goal, flow = pair
    assert not is_channel_order_swapped(image, goal, flow)
    assert is_channel_order_swapped(image[:, :, ::-1], goal, flow)
    assert is_channel_order_swapped(image, goal[:, :, ::-1], flow)
    assert not is_channel_order_swapped(image[:, :, ::-1], goal[:, :, ::-1], flow)


@pytest.mark.parametrize(("gain", "offset"), [(0.6, 0.0), (1.0, 40.0), (1.3, -30.0)])
def test_light_does_not_matter(pair, rng, gain, offset):
    image, goal, flow = pair
    lit = np.clip(gain * image + offset, 0, 255).astype(np.uint8)
    assert not is_channel_order_swapped(lit, goal, flow)
    assert is_channel_order_swapped(lit[:, :, ::-1], goal, flow)


def test_grey_pictures_say_nothing(pair):
    image, goal, flow = pair
    assert not is_channel_order_swapped(grey(image), goal, flow)
    assert not is_channel_order_swapped(image[:, :, ::-1], grey(goal), flow)


def test_few_sure_points_say_nothing(pair):
    image, goal, flow = pair
    few = np.zeros_like(flow.confidence)
    few[:40, :40] = flow.confidence[:40, :40]
    assert not is_channel_order_swapped(image[:, :, ::-1], goal, FlowField(flow.flow, few))
    away = FlowField(flow.flow + np.float32(5000), flow.confidence)
    assert not is_channel_order_swapped(image[:, :, ::-1], goal, away)


def test_other_content_is_not_an_exchange(pair, rng):
    image, _, flow = pair
    assert not is_channel_order_swapped(image, Wall(texture(rng)).picture(H), flow)


def test_frames_with_exchanged_colours_are_not_flown(rng):
    picture = Wall(texture(rng)).picture()
    perception = pipeline(picture, depth="constant")
    still = Motion.at_rest(0.0, 0.0)
    right = perception.process_frame(Frame(picture, 0, 0), still, engaged=True).report
    assert right.healthy
    swapped = np.ascontiguousarray(picture[:, :, ::-1])
    wrong = perception.process_frame(Frame(swapped, 1, 1), still, engaged=True).report
    assert not wrong.healthy
    assert not wrong.reached
    assert "exchanged" in wrong.reason
    assert wrong.velocity == (0.0, 0.0, 0.0, 0.0)
