import numpy as np

from dfvs_core.matching.correspondence import FlowField
from dfvs_service.image_drawing import draw_flow


def field(confidence):
    flow = np.full((64, 96, 2), 9.0, np.float32)
    return FlowField(flow, np.full((64, 96), confidence, np.float32))


def test_arrows_are_drawn_on_a_copy():
    image = np.full((64, 96, 3), 100, np.uint8)
    drawn = draw_flow(image, field(0.9), 0.3)
    assert (image == 100).all()
    assert (drawn != 100).any(axis=2).mean() > 0.05


def test_what_is_not_trusted_is_not_drawn():
    image = np.full((64, 96, 3), 100, np.uint8)
    assert (draw_flow(image, field(0.1), 0.3) == image).all()


def test_flow_out_of_all_bounds_does_no_harm():
    wild = FlowField(np.full((64, 96, 2), 1e9, np.float32), np.ones((64, 96), np.float32))
    assert draw_flow(np.zeros((64, 96, 3), np.uint8), wild, 0.3).shape == (64, 96, 3)
