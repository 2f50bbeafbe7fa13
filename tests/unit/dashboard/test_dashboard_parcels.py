import json

import numpy as np
import pytest

from dfvs_core.errors import DfvsError
from dfvs_core.matching.correspondence import FlowField
from dfvs_core.messages.frame import (
    Frame,
    FrameHeader,
    PixelFormat,
    encode_frame,
    encode_header,
)
from dfvs_core.messages.image import decode_image, encode_png
from dfvs_core.perception.flow_grid import encode_flow_grid, sample_flow
from dfvs_service.dashboard.outbox import ImageKind
from dfvs_service.dashboard.vehicles.sample import MAX_VIEW_WIDTH, Arrival, unpack


def frame(width=64, height=48):
    image = np.full((height, width, 3), (200, 100, 50), np.uint8)
    return Frame(image, 123, 7)


def test_a_jpeg_is_passed_on_bit_for_bit():
    payload, attachment = encode_frame(frame(), PixelFormat.JPEG)
    picture = unpack(Arrival("a", "camera", payload, attachment)).content
    assert (picture.kind, picture.t_ns, picture.seq) == (ImageKind.VIEW, 123, 7)
    assert picture.data is payload


@pytest.mark.parametrize("pixel_format", [PixelFormat.RGB8, PixelFormat.BGR8, PixelFormat.PNG])
def test_other_formats_become_jpeg_of_the_same_colours(pixel_format):
    payload, attachment = encode_frame(frame(), pixel_format)
    data = unpack(Arrival("a", "goal", payload, attachment)).content.data
    assert np.abs(decode_image(data).astype(int) - frame().image).max() < 12


def test_a_large_raw_frame_is_made_smaller():
    payload, attachment = encode_frame(frame(1920, 1080), PixelFormat.RGB8)
    data = unpack(Arrival("a", "camera", payload, attachment)).content.data
    assert decode_image(data).shape == (540, MAX_VIEW_WIDTH, 3)


def test_a_flow_grid_is_passed_on():
    flow = FlowField(np.zeros((48, 64, 2), np.float32), np.ones((48, 64), np.float32))
    data = encode_flow_grid(sample_flow(flow, 3, 99))
    picture = unpack(Arrival("a", "flow", data, b"")).content
    assert (picture.kind, picture.t_ns, picture.data) == (ImageKind.FLOW, 99, data)


def test_a_frame_tells_by_whose_clock_it_was_stamped():
    payload, attachment = encode_frame(frame(), PixelFormat.JPEG, b"c" * 16)
    assert unpack(Arrival("a", "goal", payload, attachment)).content.clock == b"c" * 16


def test_documents_are_read_from_json():
    parcel = unpack(Arrival("a", "state", json.dumps({"x": 1}).encode(), b""))
    assert (parcel.vehicle, parcel.stream, parcel.content) == ("a", "state", {"x": 1})


NO_PIXELS = FrameHeader(0, 0, PixelFormat.RGB8, 1, 123, checksum=0)
NO_PIXELS_JPEG = b"\xff\xd8\xff\xc0\x00\x11\x08\x00\x00\x00\x00" + bytes(12)
NO_PIXELS_IN_JPEG = FrameHeader(0, 0, PixelFormat.JPEG, 1, 123, checksum=0)


def hostile():
    jpeg, jpeg_header = encode_frame(frame(), PixelFormat.JPEG)
    _, small_header = encode_frame(frame(32, 24), PixelFormat.JPEG)
    raw, raw_header = encode_frame(frame(), PixelFormat.RGB8)
    return {
        "JPEG of another size": ("camera", jpeg, small_header),
        "PNG that says it is a JPEG": ("camera", encode_png(frame().image), jpeg_header),
        "nothing": ("camera", b"", jpeg_header),
        "no attachment": ("camera", jpeg, b""),
        "raw frame of no pixels": ("camera", b"", encode_header(NO_PIXELS)),
        "JPEG of no pixels": ("camera", NO_PIXELS_JPEG, encode_header(NO_PIXELS_IN_JPEG)),
        "raw frame cut short": ("goal", raw[:-1], raw_header),
        "raw frame changed": ("goal", b"\x00" + raw[1:], raw_header),
        "no grid": ("flow", b"DFVO" + bytes(30), b""),
        "no JSON": ("state", b"{", b""),
        "deep JSON": ("servo", b"[" * 60_000, b""),
        "huge JSON": ("config", b'"' + b"x" * 70_000 + b'"', b""),
        "no text": ("timing", b"\xff\xfe\x00", b""),
    }


@pytest.mark.parametrize("name", hostile())
def test_what_is_not_what_it_should_be_is_refused(name):
    with pytest.raises(DfvsError):
        unpack(Arrival("a", *hostile()[name]))
