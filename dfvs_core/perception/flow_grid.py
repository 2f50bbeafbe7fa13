"""Coarse flow grid for display, and its binary encoding.

Layout, little-endian: 24 bytes of header, then displacements as int16 in sixteenths of a pixel
(row by row, du before dv), then confidences as uint8 (255 is certain). A browser reads it with
nothing but typed arrays.
"""

import struct
from dataclasses import dataclass

import numpy as np

from dfvs_core.errors import WireError
from dfvs_core.geometry.arrays import Float32Array
from dfvs_core.matching.correspondence import FlowField
from dfvs_core.servo.points import sample_grid

FLOW_GRID_ENCODING = "application/x-dfvs-flow-grid"
MAX_COLUMNS = 40

_HEADER = struct.Struct("<4sBxHHHIq")
_MAGIC = b"DFVO"
_VERSION = 1
_STEPS_PER_PX = 16.0
_MOST_STEPS = 32767.0


@dataclass(frozen=True, slots=True)
class FlowGrid:
    """Flow and confidence at every ``stride_px``-th pixel of one frame.

    Parameters
    ----------
    flow : (h, w, 2) float32
        Displacement to the goal image, px of the camera's image.
    confidence : (h, w) float32
        0 to 1.
    stride_px : int
        Distance of the grid's points; the first one is half of it (rounded down) from the corner.
    seq, t_capture_ns : int
        Of the frame.
    """

    flow: Float32Array
    confidence: Float32Array
    stride_px: int
    seq: int
    t_capture_ns: int


def sample_flow(field: FlowField, seq: int, t_capture_ns: int) -> FlowGrid:
    """Coarse grid of a flow field, at most ``MAX_COLUMNS`` wide."""
    stride = max(1, -(-field.confidence.shape[1] // MAX_COLUMNS))
    samples = sample_grid(field, stride)
    return FlowGrid(
        samples.flow.astype(np.float32),
        samples.confidence.astype(np.float32),
        stride,
        seq,
        t_capture_ns,
    )


def encode_flow_grid(grid: FlowGrid) -> bytes:
    """Bytes of a grid; what is not finite is sent as zero flow of no confidence."""
    height, width = grid.confidence.shape
    finite = np.isfinite(grid.flow).all(axis=-1) & np.isfinite(grid.confidence)
    flow = np.where(finite[..., None], grid.flow, 0.0)
    steps = np.clip(np.rint(flow * _STEPS_PER_PX), -_MOST_STEPS, _MOST_STEPS).astype("<i2")
    confident = np.where(finite, np.clip(grid.confidence, 0.0, 1.0), 0.0)
    header = _HEADER.pack(
        _MAGIC, _VERSION, width, height, grid.stride_px, grid.seq & 0xFFFFFFFF, grid.t_capture_ns
    )
    return header + steps.tobytes() + np.rint(confident * 255.0).astype(np.uint8).tobytes()


def decode_flow_grid(data: bytes) -> FlowGrid:
    """Grid from its bytes.

    Raises
    ------
    WireError
        If the bytes are not a grid of ours, whole.
    """
    if len(data) < _HEADER.size:
        raise WireError(f"flow grid of {len(data)} bytes", f"at least {_HEADER.size}")
    magic, version, width, height, stride, seq, t_capture_ns = _HEADER.unpack_from(data)
    if magic != _MAGIC or version != _VERSION:
        raise WireError(f"flow grid {magic!r} version {version}", f"{_MAGIC!r} {_VERSION}")
    points = width * height
    if width > MAX_COLUMNS or len(data) != _HEADER.size + 5 * points:
        raise WireError(
            f"flow grid of {len(data)} bytes for {width} x {height} points",
            f"{_HEADER.size + 5 * points} bytes and at most {MAX_COLUMNS} columns",
        )
    steps = np.frombuffer(data, "<i2", 2 * points, _HEADER.size)
    confident = np.frombuffer(data, np.uint8, points, _HEADER.size + 4 * points)
    return FlowGrid(
        steps.reshape(height, width, 2).astype(np.float32) / np.float32(_STEPS_PER_PX),
        confident.reshape(height, width).astype(np.float32) / np.float32(255.0),
        stride,
        seq,
        t_capture_ns,
    )
