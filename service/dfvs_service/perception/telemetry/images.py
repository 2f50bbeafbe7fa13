"""Telemetry images: preview, goal image and flow."""

import dataclasses
from typing import cast

import cv2

from dfvs_core.geometry.arrays import ImageArray
from dfvs_core.matching.correspondence import FlowField
from dfvs_core.matching.warping import flow_at_size
from dfvs_core.messages.frame import Frame, PixelFormat, encode_frame
from dfvs_core.messages.image import encode_jpeg
from dfvs_core.perception.flow_grid import FLOW_GRID_ENCODING, encode_flow_grid, sample_flow
from dfvs_service.image_drawing import at_width, draw_flow
from dfvs_service.telemetry import Note

_GOAL_QUALITY = 90
_REDUCED_QUALITIES = (75, 60, 45)
"""Of a goal image for the black box that is too large at full quality."""
_THUMBNAIL_QUALITY = 70
_THUMBNAIL_WIDTH = 240
"""Width of the black box's views, px."""


class TelemetryImages:
    """Makes notes of images and flow; called on the telemetry thread.

    ``clock`` is the identity of the clock that frames are stamped with. The preview has JPEG
    ``quality`` 1 to 100, and shows no flow below ``min_confidence``. ``max_kept_bytes`` fit into a
    record of the black box.
    """

    def __init__(
        self, clock: bytes, min_confidence: float, quality: int, max_kept_bytes: int
    ) -> None:
        self._clock = clock
        self._min_confidence = min_confidence
        self._quality = quality
        self._max_kept_bytes = max_kept_bytes

    def preview(self, frame: Frame, flow: FlowField) -> Note:
        """JPEG of the view with the flow drawn on it, as a frame on the wire."""
        drawn = draw_flow(frame.image, _of_frame(flow, frame), self._min_confidence)
        return self._jpeg(Frame(drawn, frame.t_capture_ns, frame.seq), self._quality)

    def thumbnail(self, frame: Frame) -> Note:
        """Small JPEG of the view alone."""
        small = at_width(frame.image, _THUMBNAIL_WIDTH)
        return self._jpeg(Frame(small, frame.t_capture_ns, frame.seq), _THUMBNAIL_QUALITY)

    def goal(self, image: ImageArray, t_ns: int) -> Note:
        """JPEG of the goal image (H, W, 3), stamped with the time of publishing.

        The black box keeps a reduced one where it is too large.
        """
        note = self._jpeg(Frame(image, t_ns, 0), _GOAL_QUALITY)
        if len(note.payload) <= self._max_kept_bytes:
            return note
        return dataclasses.replace(note, kept=_reduced_jpeg(image, self._max_kept_bytes))

    def flow(self, frame: Frame, flow: FlowField) -> Note:
        """Coarse grid of the flow to the goal."""
        grid = sample_flow(_of_frame(flow, frame), frame.seq, frame.t_capture_ns)
        return Note(encode_flow_grid(grid), FLOW_GRID_ENCODING)

    def _jpeg(self, frame: Frame, quality: int) -> Note:
        payload, attachment = encode_frame(frame, PixelFormat.JPEG, self._clock, quality)
        return Note(payload, "image/jpeg", attachment)


def _reduced_jpeg(image: ImageArray, max_bytes: int) -> bytes:
    """JPEG of an image (H, W, 3) of a lower quality, and of half the size until it fits."""
    for quality in _REDUCED_QUALITIES:
        if len(jpeg := encode_jpeg(image, quality)) <= max_bytes:
            return jpeg
    height, width = image.shape[:2]
    if min(height, width) < 2:
        return jpeg
    half = cv2.resize(image, (width // 2, height // 2), interpolation=cv2.INTER_AREA)
    return _reduced_jpeg(cast(ImageArray, half), max_bytes)


def _of_frame(flow: FlowField, frame: Frame) -> FlowField:
    """Flow in px of the frame."""
    return flow_at_size(flow, (frame.image.shape[0], frame.image.shape[1]))
