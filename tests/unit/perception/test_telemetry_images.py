"""Telemetry images: what is published, and what the black box keeps of it."""

import numpy as np
import pytest

from dfvs_core.messages.image import decode_image
from dfvs_service.perception.telemetry.images import TelemetryImages

CLOCK = bytes(16)
NOISE = np.random.default_rng(5).integers(0, 256, (480, 640, 3), np.uint8)


def test_a_goal_that_fits_is_kept_as_it_is_published():
    assert TelemetryImages(CLOCK, 0.3, 70, 1_000_000).goal(NOISE, 7).kept is None


@pytest.mark.parametrize(("max_bytes", "shape"), [(200_000, (480, 640)), (20_000, (240, 320))])
def test_a_goal_that_is_too_large_for_the_black_box_is_kept_reduced(max_bytes, shape):
    note = TelemetryImages(CLOCK, 0.3, 70, max_bytes).goal(NOISE, 7)
    assert decode_image(note.payload).shape == NOISE.shape
    assert len(note.kept) <= max_bytes < len(note.payload)
    assert decode_image(note.kept).shape[:2] == shape
