"""The picture of a check: what it shows, and which frame it is of."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from dfvs_core.errors import WireError
from dfvs_core.messages.frame import Frame, PixelFormat, encode_frame
from dfvs_core.messages.frame_record import FrameInput, FrameRecord, pack
from dfvs_core.messages.link import PerceptionReport
from dfvs_core.perception.flow_grid import FlowGrid, encode_flow_grid
from dfvs_service.preflight.image import draw_image
from dfvs_service.preflight.live_view import View, ViewCollector

GOAL = np.full((60, 80, 3), 128, np.uint8)
GREEN, ORANGE = (64, 235, 96), (255, 176, 32)
MS = 1_000_000


def grid(confidence, t_capture_ns=0):
    flow = np.full((6, 8, 2), 5.0, np.float32)
    return FlowGrid(flow, np.full((6, 8), confidence, np.float32), 10, 0, t_capture_ns)


def colours(picture):
    """Whether the frame's half has green and orange arrows."""
    half = picture[30:300, -480:].reshape(-1, 3)
    return tuple(bool((half == colour).all(axis=1).any()) for colour in (GREEN, ORANGE))


@pytest.mark.parametrize(
    ("confidence", "arrows"), [(1.0, (True, False)), (0.55, (False, True)), (0.1, (False, False))]
)
def test_arrows_say_how_sure_the_flow_is(confidence, arrows):
    assert colours(draw_image(GOAL, View(GOAL, grid(confidence)), 0.5)) == arrows


def test_goal_and_frame_stand_side_by_side_above_the_numbers():
    picture = draw_image(GOAL, View(GOAL // 2), 0.5)
    assert picture[180, 240].tolist() == [128, 128, 128]
    assert picture[180, -240].tolist() == [64, 64, 64]
    assert picture.shape[0] > 360 + 60


@settings(max_examples=30, deadline=None)
@given(
    st.dictionaries(
        st.sampled_from(["velocity", "error_m", "error_rad", "overlap", "status", "reason"]),
        st.none() | st.floats() | st.text() | st.lists(st.none() | st.floats(), max_size=6),
    )
)
def test_any_servo_document_and_no_frame_give_a_picture(servo):
    assert draw_image(GOAL, View(None, None, servo), 0.5).ndim == 3


def turn(t_capture_ns, grey):
    image = np.full((60, 80, 3), grey, np.uint8)
    payload, attachment = encode_frame(Frame(image, t_capture_ns, 1), PixelFormat.PNG, bytes(16))
    still = (0.0, 0.0, 0.0, 0.0)
    report = PerceptionReport(1, t_capture_ns, still, True, False, False, "", 0.0, 0.0, 1.0)
    servo = {"t_capture_ns": t_capture_ns, "error_m": grey / 100.0}
    sight = FrameInput(attachment.hex(), t_capture_ns, t_capture_ns)
    return pack(FrameRecord(1, 0, t_capture_ns, (), report, sight, servo), payload)


def test_flow_is_shown_on_the_very_frame_that_it_is_of():
    views = ViewCollector()
    for number in (1, 2, 3):
        views.add_record(turn(number * MS, 50 * number))
    assert views.view().image[0, 0, 0] == 150
    assert views.view().flow is None
    views.add_flow(encode_flow_grid(grid(1.0, 2 * MS)))
    views.add_flow(encode_flow_grid(grid(1.0, 9 * MS)))  # of a frame that was not heard
    view = views.view()
    assert (view.image[0, 0, 0], view.flow.t_capture_ns, view.servo["error_m"]) == (100, 2 * MS, 1)


def test_what_is_no_message_is_refused():
    with pytest.raises(WireError):
        ViewCollector().add_record(b"turn")
