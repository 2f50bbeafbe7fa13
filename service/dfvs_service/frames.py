"""Frames between processes: raw samples, captured images, and the images of frame records."""

from dataclasses import dataclass

from dfvs_core.errors import DfvsError
from dfvs_core.geometry.arrays import ImageArray
from dfvs_core.messages.frame import decode_frame, decode_header
from dfvs_core.messages.frame_record import FrameRecord


@dataclass(frozen=True, slots=True)
class RawSample:
    """A frame as it came: payload, attachment and the time of its arrival.

    ``publisher`` is the id of the Zenoh session that stamped it, empty where none did.
    """

    payload: bytes
    attachment: bytes
    t_arrival_ns: int
    publisher: str = ""


@dataclass(frozen=True, slots=True)
class CapturedImage:
    """An image (H, W, 3) uint8 RGB; when it was taken, on the monotonic clock."""

    image: ImageArray
    t_capture_ns: int


def record_image(record: FrameRecord, payload: bytes) -> ImageArray | None:
    """Image (H, W, 3) RGB that a frame record looked at; None for nothing that can be decoded."""
    if record.sight is None:
        return None
    try:
        return decode_frame(payload, decode_header(bytes.fromhex(record.sight.attachment))).image
    except DfvsError:
        return None
