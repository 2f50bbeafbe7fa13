"""Camera image of a frame record."""

from dfvs_core.errors import DfvsError
from dfvs_core.geometry.arrays import ImageArray
from dfvs_core.messages.frame import decode_frame, decode_header
from dfvs_core.messages.frame_record import FrameRecord


def record_image(record: FrameRecord, payload: bytes) -> ImageArray | None:
    """Image (H, W, 3) RGB that a frame record looked at; None for nothing that can be decoded."""
    if record.sight is None:
        return None
    try:
        return decode_frame(payload, decode_header(bytes.fromhex(record.sight.attachment))).image
    except DfvsError:
        return None
