"""Samples from vehicles, decoded: JSON documents, and images for a browser."""

import json
from dataclasses import dataclass
from typing import Any

from dfvs_core.errors import WireError
from dfvs_core.messages.frame import NO_CLOCK, FrameHeader, PixelFormat, decode_frame, decode_header
from dfvs_core.messages.image import MAX_IMAGE_PIXELS, encode_jpeg, image_size
from dfvs_core.perception.flow_grid import decode_flow_grid
from dfvs_service.dashboard.outbox import ImageKind
from dfvs_service.image_drawing import at_width

MAX_DOCUMENT_BYTES = 64 * 1024
VIEW_QUALITY = 75
MAX_VIEW_WIDTH = 960


@dataclass(frozen=True, slots=True)
class Arrival:
    """One sample as it came: whose, of which stream, payload and attachment.

    ``replaced`` counts the arrivals of its stream, directly before it, that nobody has read.
    """

    vehicle: str
    stream: str
    payload: bytes
    attachment: bytes
    replaced: int = 0


@dataclass(frozen=True, slots=True)
class BrowserImage:
    """JPEG, or flow grid, with the monotonic time of its capture, its number, and whose clock."""

    kind: ImageKind
    t_ns: int
    seq: int
    data: bytes
    clock: bytes = NO_CLOCK


@dataclass(frozen=True, slots=True)
class Sample:
    """An arrival that could be read: an image, or a document from JSON; ``replaced`` as there."""

    vehicle: str
    stream: str
    content: BrowserImage | Any
    replaced: int = 0


def unpack(arrival: Arrival) -> Sample:
    """Read an arrival.

    Raises
    ------
    DfvsError
        If it is not what its stream should carry.
    """
    return Sample(arrival.vehicle, arrival.stream, _content(arrival), arrival.replaced)


def _content(arrival: Arrival) -> BrowserImage | Any:
    if arrival.stream == "flow":
        grid = decode_flow_grid(arrival.payload)
        return BrowserImage(ImageKind.FLOW, grid.t_capture_ns, grid.seq, arrival.payload)
    if arrival.stream in ("camera", "goal"):
        header, jpeg = browser_jpeg(arrival.payload, arrival.attachment)
        kind = ImageKind.GOAL if arrival.stream == "goal" else ImageKind.VIEW
        return BrowserImage(kind, header.t_capture_ns, header.seq, jpeg, header.clock)
    if len(arrival.payload) > MAX_DOCUMENT_BYTES:
        raise WireError(
            f"document of {len(arrival.payload)} bytes", f"at most {MAX_DOCUMENT_BYTES}"
        )
    try:
        return json.loads(arrival.payload)
    except (ValueError, RecursionError) as error:
        raise WireError(f"{arrival.stream} telemetry is not JSON: {error}") from error


def browser_jpeg(payload: bytes, attachment: bytes) -> tuple[FrameHeader, bytes]:
    """Header and JPEG bytes of a frame on the wire.

    A JPEG is passed on unopened, once its own header agrees with the frame's; other formats are
    decoded, made at most ``MAX_VIEW_WIDTH`` wide, and encoded.

    Raises
    ------
    WireError
        If the attachment is not a frame's, or the sizes disagree or are beyond all use.
    ImageError
        If the image cannot be decoded.
    """
    header = decode_header(attachment)
    width, height = header.width, header.height
    if width < 1 or height < 1 or width * height > MAX_IMAGE_PIXELS:
        raise WireError(f"frame of {width} x {height} px", f"1 to {MAX_IMAGE_PIXELS} px in all")
    if header.pixel_format is PixelFormat.JPEG:
        if not payload.startswith(b"\xff\xd8") or image_size(payload) != (width, height):
            raise WireError(f"the frame is no JPEG of {width} x {height} px")
        return header, payload
    image = decode_frame(payload, header).image
    if width > MAX_VIEW_WIDTH:
        image = at_width(image, MAX_VIEW_WIDTH)
    return header, encode_jpeg(image, VIEW_QUALITY)
