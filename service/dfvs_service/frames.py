"""Frames between processes: raw samples of the wire, and captured images."""

from dataclasses import dataclass

from dfvs_core.geometry.arrays import ImageArray


@dataclass(frozen=True, slots=True)
class RawSample:
    """A frame as it came: payload, attachment and the time of its arrival."""

    payload: bytes
    attachment: bytes
    t_arrival_ns: int


@dataclass(frozen=True, slots=True)
class CapturedImage:
    """An image (H, W, 3) uint8 RGB; when it was taken, on the monotonic clock."""

    image: ImageArray
    t_capture_ns: int
