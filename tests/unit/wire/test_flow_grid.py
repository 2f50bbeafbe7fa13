import numpy as np
import pytest

from dfvs_core.errors import WireError
from dfvs_core.matching.correspondence import FlowField
from dfvs_core.perception.flow_grid import (
    MAX_COLUMNS,
    FlowGrid,
    decode_flow_grid,
    encode_flow_grid,
    sample_flow,
)


def ramp_field(width=320, height=240):
    v, u = np.mgrid[0:height, 0:width].astype(np.float32)
    confidence = (u / width).astype(np.float32)
    return FlowField(np.stack([u * 0.25, -v * 0.5], axis=-1), confidence)


@pytest.mark.parametrize("size", [(320, 240), (640, 480), (37, 11), (1, 1)])
def test_a_grid_is_narrow_and_says_where_its_points_are(size):
    field = ramp_field(*size)
    grid = sample_flow(field, 7, 123)
    rows, columns = grid.confidence.shape
    assert columns <= MAX_COLUMNS
    offset = grid.stride_px // 2
    for row, column in ((0, 0), (rows - 1, columns - 1)):
        v, u = offset + row * grid.stride_px, offset + column * grid.stride_px
        np.testing.assert_array_equal(grid.flow[row, column], field.flow[v, u])


def test_a_grid_survives_the_wire_within_its_steps():
    grid = sample_flow(ramp_field(), 2**32 - 1, 9_876_543_210_123)
    again = decode_flow_grid(encode_flow_grid(grid))
    np.testing.assert_allclose(again.flow, grid.flow, atol=1 / 32)
    np.testing.assert_allclose(again.confidence, grid.confidence, atol=0.5 / 255 + 1e-6)
    assert (again.stride_px, again.seq, again.t_capture_ns) == (8, 2**32 - 1, 9_876_543_210_123)


def test_a_grid_for_the_usual_frame_takes_six_kilobytes():
    assert len(encode_flow_grid(sample_flow(ramp_field(), 0, 0))) == 24 + 40 * 30 * 5


def test_what_is_not_finite_travels_as_nothing():
    flow = np.full((2, 2, 2), np.nan, np.float32)
    flow[0, 0] = (1.0, 2.0)
    flow[0, 1] = (1e30, -1e30)
    confidence = np.array([[1.0, 1.0], [1.0, np.inf]], np.float32)
    again = decode_flow_grid(encode_flow_grid(FlowGrid(flow, confidence, 8, 1, 2)))
    np.testing.assert_array_equal(again.flow[0, 0], (1.0, 2.0))
    np.testing.assert_array_equal(again.confidence, [[1.0, 1.0], [0.0, 0.0]])
    assert again.flow[0, 1, 0] > 2000 > -2000 > again.flow[0, 1, 1]
    assert (again.flow[1] == 0).all()


def test_bytes_that_are_no_grid_are_refused():
    good = encode_flow_grid(sample_flow(ramp_field(), 1, 2))
    wide = bytearray(good)
    wide[6:8] = (2000).to_bytes(2, "little")
    for data in (b"", good[:20], good[:-1], good + b"x", b"XXXX" + good[4:], bytes(wide)):
        with pytest.raises(WireError):
            decode_flow_grid(data)
