"""Publisher of camera frames over Zenoh, with reports of their rate and reception."""

import threading
import time
from collections.abc import Callable
from dataclasses import dataclass

import zenoh
import zenoh.ext

from dfvs_common.clock import local_clock
from dfvs_core.geometry.camera import CameraModel
from dfvs_core.messages.frame import Frame, PixelFormat, check_frame_size, encode_frame
from dfvs_core.messages.schema import to_json
from dfvs_core.messages.topics import Topics
from dfvs_service.camera.feed import Feed, Log
from dfvs_service.camera.sources.source import check_size
from dfvs_service.camera.sources.spec import CameraError
from dfvs_service.frames import CapturedImage
from dfvs_service.zenoh_session import has_subscriber, publish_kept

JPEG_QUALITY = 90
_RECEIVE_S = 0.25
_REPORT_S = 5.0
_SILENCE_S = 2.0
_PATIENCE_S = 2.0
_REMEDY = (
    "start the service, or compare --vehicle and --connect with its settings; with TLS, the "
    "camera's certificate must have the role of a camera"
)


@dataclass(frozen=True, slots=True)
class PublishOptions:
    """What is published; ``camera`` is the calibration where one is known."""

    vehicle: str
    pixel_format: PixelFormat = PixelFormat.JPEG
    quality: int = JPEG_QUALITY
    camera: CameraModel | None = None
    size: tuple[int, int] | None = None
    max_frames: int | None = None
    required_subscriber_s: float | None = None
    """Without a subscriber for so long publishing ends."""

    @property
    def wanted_size(self) -> tuple[int, int] | None:
        """Size (width, height) px that every image must have, None for any."""
        return self.size if self.camera is None else self.camera.size


class FramePublisher:
    """Puts frames on the vehicle's camera key, and its calibration for whoever asks."""

    def __init__(self, session: zenoh.Session, options: PublishOptions) -> None:
        topics = Topics(options.vehicle)
        drop = zenoh.CongestionControl.DROP
        self._options = options
        self._clock = local_clock()
        self._frames = session.declare_publisher(topics.camera, congestion_control=drop)
        self._calibration: zenoh.ext.AdvancedPublisher | None = None
        if options.camera is not None:
            self._calibration = publish_kept(session, topics.calibration)
            self._calibration.put(to_json(options.camera), encoding="application/json")
        self.count = 0
        self.bytes = 0

    @property
    def is_received(self) -> bool:
        """Whether Zenoh knows a subscriber of the frames."""
        return has_subscriber(self._frames)

    def publish(self, captured: CapturedImage) -> None:
        """Publish one image.

        Raises
        ------
        CameraError
            If it has not the size of the calibration.
        ImageError
            If it is too large for a message.
        """
        check_size(captured.image, self._options.wanted_size, "the camera")
        pixel_format = self._options.pixel_format
        frame = Frame(captured.image, captured.t_capture_ns, self.count)
        payload, attachment = encode_frame(frame, pixel_format, self._clock, self._options.quality)
        check_frame_size(payload)
        self._frames.put(payload, encoding=pixel_format.media_type, attachment=attachment)
        self.count += 1
        self.bytes += len(payload)


@dataclass(slots=True)
class RateReport:
    """Logs how many frames go out, and when they cease to."""

    log: Log
    next_s: float
    last_frame_s: float
    count: int = 0
    bytes: int = 0
    is_silent: bool = False

    def frame(self, now_s: float, size: int) -> None:
        """Count a frame of so many bytes."""
        self.count += 1
        self.bytes += size
        self.last_frame_s = now_s
        self.is_silent = False

    def update(self, now_s: float) -> None:
        """Log what is due."""
        if now_s - self.last_frame_s > _SILENCE_S and not self.is_silent:
            self.is_silent = True
            self.log(f"no image for {now_s - self.last_frame_s:.1f} s")
        if now_s < self.next_s:
            return
        if self.count:
            rate, size = self.count / _REPORT_S, self.bytes / self.count
            self.log(f"{rate:.1f} frames a second, {size / 1000:.0f} kB each")
        self.next_s = now_s + _REPORT_S
        self.count = self.bytes = 0


@dataclass(slots=True)
class ReceptionReport:
    """Logs when nobody receives the frames, and when somebody does again.

    ``key`` is the Zenoh key of the frames, and ``lost_s`` the monotonic time since which nobody is
    known to receive. Without a subscriber for ``required_s`` the camera ends.
    """

    log: Log
    key: str
    lost_s: float
    required_s: float | None = None
    is_received: bool = False
    is_reported: bool = False

    def update(self, now_s: float, *, is_received: bool) -> None:
        """Take whether there is a subscriber now.

        Raises
        ------
        CameraError
            If there was none for ``required_s``.
        """
        if is_received:
            if self.is_reported:
                self.log(f"{self.key} has a subscriber")
            self.is_received, self.is_reported = True, False
            return
        if self.is_received:
            self.is_received, self.lost_s = False, now_s
        alone_s = now_s - self.lost_s
        if self.required_s is not None and alone_s >= self.required_s:
            raise CameraError(
                f"nobody receives {self.key} for {alone_s:.0f} s", "a subscriber", _REMEDY
            )
        if alone_s >= _PATIENCE_S and not self.is_reported:
            self.is_reported = True
            self.log(f"nobody receives {self.key}: {_REMEDY}")


def publish_feed(
    feed: Feed,
    publisher: FramePublisher,
    options: PublishOptions,
    stop: threading.Event,
    log: Callable[[str], None],
) -> None:
    """Publish until stopped, until the recording ends, or until enough frames went out.

    Raises
    ------
    DfvsError
        If the source cannot be used, or nobody receives where somebody must.
    """
    now_s = time.monotonic()
    report = RateReport(log, now_s + _REPORT_S, now_s)
    key = Topics(options.vehicle).camera
    reception = ReceptionReport(log, key, now_s, options.required_subscriber_s)
    while not stop.is_set() and not feed.ended:
        captured = feed.receive(_RECEIVE_S)
        if captured is not None:
            before = publisher.bytes
            publisher.publish(captured)
            report.frame(time.monotonic(), publisher.bytes - before)
            if options.max_frames is not None and publisher.count >= options.max_frames:
                return
        now_s = time.monotonic()
        report.update(now_s)
        reception.update(now_s, is_received=publisher.is_received)
