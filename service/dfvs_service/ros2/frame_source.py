"""Frame source of a ROS 2 camera, which rewrites samples to the DFVS wire format.

What comes after (age, order, size, frozen images, recording) is the same for all cameras.
"""

import time
import zlib
from collections.abc import Callable
from dataclasses import dataclass

from dfvs_common.ros2 import decode, typestore
from dfvs_core.errors import WireError
from dfvs_core.geometry.camera import CameraModel
from dfvs_core.messages.frame import FrameHeader, encode_header
from dfvs_core.messages.ros2 import (
    CAMERA_INFO,
    COMPRESSED_IMAGE,
    IMAGE,
    Ros2Link,
    Ros2Topic,
    decode_attachment,
)
from dfvs_service.frames import RawSample
from dfvs_service.ros2.images import Pixels, camera_of, from_compressed, from_image
from dfvs_service.settings.camera_section import Ros2CameraSection

MS = 1_000_000
CLOCK_STEP_NS = 10 * MS
"""The system clock is slewed by far less than this between two frames."""
_RECTIFIED = "image_rect"
"""How the names of rectified images begin (image_proc, stereo_image_proc)."""


@dataclass(frozen=True, slots=True)
class ClockReading:
    """Both clocks read at the same moment, ns."""

    wall_ns: int
    monotonic_ns: int


def read_clocks() -> ClockReading:
    """Read this machine's clocks."""
    return ClockReading(time.time_ns(), time.monotonic_ns())


class WallClock:
    """Takes wall-clock stamps to the monotonic clock, and notices when the wall clock is set.

    A frame that was stamped before the clock was set would seem younger or older than it is, so
    the first one after is refused.
    """

    def __init__(self) -> None:
        self._offset_ns: int | None = None

    def monotonic_of(self, stamp_ns: int, now: ClockReading) -> int:
        """Monotonic time of a stamp.

        Raises
        ------
        WireError
            If the wall clock was set since the last call.
        """
        offset_ns = now.wall_ns - now.monotonic_ns
        before_ns, self._offset_ns = self._offset_ns, offset_ns
        if before_ns is not None and abs(offset_ns - before_ns) > CLOCK_STEP_NS:
            step_ms = (offset_ns - before_ns) / MS
            raise WireError(f"the system clock was set by {step_ms:.0f} ms since the last frame")
        return stamp_ns - offset_ns


class Ros2FrameSource:
    """Rewrites samples of one ROS 2 image topic.

    ``clock`` is the identity of this machine's monotonic clock; ``clocks`` reads both clocks.
    """

    def __init__(
        self,
        link: Ros2Link,
        section: Ros2CameraSection,
        clock: bytes,
        clocks: Callable[[], ClockReading] = read_clocks,
    ) -> None:
        typestore()  # takes its time to load: before the first frame
        self._is_compressed = section.compressed
        self._type_name = COMPRESSED_IMAGE if section.compressed else IMAGE
        self._clock = clock
        self._clocks = clocks
        self._wall_clock = WallClock()
        self._count = 0
        self._camera = ("", "")
        image = Ros2Topic(section.topic, self._type_name, section.domain)
        *namespace, name = image.plain.removesuffix("/compressed").split("/")
        self._is_rectified = name.startswith(_RECTIFIED)
        info_name = section.info_topic or "/".join([*namespace, "camera_info"])
        self.key = image.key(link)
        self.calibration_key = Ros2Topic(info_name, CAMERA_INFO, section.domain).key(link)

    def camera(self, payload: bytes) -> CameraModel | None:
        """Camera of a CameraInfo, None where it is not calibrated.

        Raises
        ------
        DfvsError
            If the bytes are no CameraInfo, or describe a camera that our model cannot hold.
        """
        return camera_of(decode(CAMERA_INFO, payload), self._is_rectified)

    def translate(self, sample: RawSample) -> RawSample:
        """Sample in our own wire format.

        Raises
        ------
        DfvsError
            If it is no message of the type, the message cannot be used, or another camera sent the
            one before.
        """
        now = self._clocks()
        message = decode(self._type_name, sample.payload)
        pixels = from_compressed(message) if self._is_compressed else from_image(message)
        seq, publisher = self._count_of(sample)
        self._require_same_camera(str(message.header.frame_id), publisher)
        t_ns = self._wall_clock.monotonic_of(pixels.stamp_ns, now)
        if t_ns < 0:
            raise WireError(
                f"the image was taken {(now.monotonic_ns - t_ns) / 1e9:.0f} s ago by its stamp",
                "header.stamp on this machine's system clock",
            )
        header = self._header(pixels, seq, t_ns)
        return RawSample(pixels.payload, encode_header(header), sample.t_arrival_ns)

    def _require_same_camera(self, frame_id: str, publisher: str) -> None:
        """Tell two cameras on one topic by their coordinate frames and publishers."""
        before, self._camera = self._camera, (frame_id, publisher)
        for name, last, this in zip(("frame_id", "publisher"), before, self._camera, strict=True):
            if last not in ("", this):
                raise WireError(
                    f"the image's {name} is {this[:40]!r}, the last one's {last[:40]!r}",
                    "one camera on the topic",
                    "give each camera a topic of its own",
                )

    def _count_of(self, sample: RawSample) -> tuple[int, str]:
        """Count and id of the publisher: its own where it sends them, else ours and the bridge."""
        self._count += 1
        try:
            attached = decode_attachment(sample.attachment)
        except WireError:
            return self._count, sample.publisher
        return attached.seq & 0xFFFF_FFFF_FFFF_FFFF, attached.gid.hex()

    def _header(self, pixels: Pixels, seq: int, t_ns: int) -> FrameHeader:
        return FrameHeader(
            width=pixels.width,
            height=pixels.height,
            pixel_format=pixels.pixel_format,
            seq=seq,
            t_capture_ns=t_ns,
            checksum=zlib.crc32(pixels.payload),
            clock=self._clock,
        )
