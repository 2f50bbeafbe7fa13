"""Image sources through OpenCV: V4L2, network streams, GStreamer pipelines, video files."""

import os
import time
from pathlib import Path

import cv2
import numpy as np

from dfvs_service.camera.sources.source import SourceOptions
from dfvs_service.camera.sources.spec import CameraError, SourceKind, SourceLostError, SourceSpec
from dfvs_service.frames import CapturedImage

TIMEOUT_MS = 4000
_LIMITS = [cv2.CAP_PROP_OPEN_TIMEOUT_MSEC, TIMEOUT_MS, cv2.CAP_PROP_READ_TIMEOUT_MSEC, TIMEOUT_MS]
_MOST_AGE_NS = 1_000_000_000
_BACKENDS = {
    SourceKind.V4L2: cv2.CAP_V4L2,
    SourceKind.STREAM: cv2.CAP_FFMPEG,
    SourceKind.VIDEO: cv2.CAP_FFMPEG,
    SourceKind.GSTREAMER: cv2.CAP_GSTREAMER,
}


def buffer_time_ns(buffer_ms: float, now_ns: int) -> int | None:
    """Monotonic capture time of a V4L2 frame by the driver's stamp, None where that is none.

    The kernel stamps buffers on the monotonic clock; a driver that stamps with another clock, or
    not at all, gives values that no fresh frame can have.
    """
    stamp_ns = round(buffer_ms * 1e6)
    return stamp_ns if 0 < stamp_ns <= now_ns < stamp_ns + _MOST_AGE_NS else None


class CaptureSource:
    """A source that OpenCV opens.

    Raises
    ------
    SourceLostError
        If a live source cannot be reached right now.
    CameraError
        If OpenCV was built without what it takes, or a video file cannot be read.
    """

    def __init__(self, spec: SourceSpec, options: SourceOptions) -> None:
        self._spec = spec
        self._options = options
        self._capture = _opened(spec, options)
        rate_hz = self._capture.get(cv2.CAP_PROP_FPS)
        self.rate_hz = float(rate_hz) if 0 < rate_hz < 1000 else 0.0

    def read(self) -> CapturedImage | None:
        """Wait for the next image."""
        if not self._capture.grab():
            self._check_ended()
            return None
        t_ns = self._capture_time_ns()
        ok, bgr = self._capture.retrieve()
        if not ok or bgr is None:
            self._check_ended()
            return None
        if bgr.ndim != 3 or bgr.shape[2] != 3 or bgr.dtype != np.uint8:
            raise CameraError(
                f"{self._spec} gives images of shape {bgr.shape}", "colour with 8 bits"
            )
        return CapturedImage(np.ascontiguousarray(bgr[:, :, ::-1]), t_ns)

    def close(self) -> None:
        """Release the device."""
        self._capture.release()

    def _capture_time_ns(self) -> int:
        now_ns = time.monotonic_ns()
        stamp_ns = None
        if self._spec.kind is SourceKind.V4L2:
            stamp_ns = buffer_time_ns(self._capture.get(cv2.CAP_PROP_POS_MSEC), now_ns)
        return now_ns - self._options.latency_ns if stamp_ns is None else stamp_ns

    def _check_ended(self) -> None:
        """A recording may end; a camera may not."""
        if self._spec.is_live:
            raise SourceLostError(f"{self._spec} gives no more images")


def _opened(spec: SourceSpec, options: SourceOptions) -> cv2.VideoCapture:
    backend = _BACKENDS[spec.kind]
    if not cv2.videoio_registry.hasBackend(backend) or not _is_built_in(spec.kind):
        raise CameraError(
            f"this OpenCV ({cv2.__version__}) was built without {spec.kind} support",
            "an OpenCV with GStreamer (the wheel from PyPI has none; Debian's python3-opencv has)"
            if spec.kind is SourceKind.GSTREAMER
            else "another build of OpenCV",
            "or use a device or an rtsp:// address directly",
        )
    capture = cv2.VideoCapture()
    capture.open(spec.place, backend, _LIMITS if spec.kind is SourceKind.STREAM else [])
    if not capture.isOpened():
        raise _not_opened(spec)
    if backend == cv2.CAP_FFMPEG:  # pixels stay where the sensor had them, as of images
        capture.set(cv2.CAP_PROP_ORIENTATION_AUTO, 0)
    if spec.kind is SourceKind.V4L2:
        _configure(capture, options)
    return capture


def _is_built_in(kind: SourceKind) -> bool:
    """The registry lists backends that only a plugin could provide; the build is right."""
    if kind is not SourceKind.GSTREAMER:
        return True
    lines = cv2.getBuildInformation().splitlines()
    return any("GStreamer:" in line and "YES" in line for line in lines)


def _configure(capture: cv2.VideoCapture, options: SourceOptions) -> None:
    """Compressed over USB, the wanted size and rate, and no queue of old images."""
    capture.set(cv2.CAP_PROP_FOURCC, cv2.VideoWriter.fourcc(*"MJPG"))
    if options.size is not None:
        capture.set(cv2.CAP_PROP_FRAME_WIDTH, options.size[0])
        capture.set(cv2.CAP_PROP_FRAME_HEIGHT, options.size[1])
    if options.rate_hz is not None:
        capture.set(cv2.CAP_PROP_FPS, options.rate_hz)
    capture.set(cv2.CAP_PROP_BUFFERSIZE, 1)


def _not_opened(spec: SourceSpec) -> SourceLostError | CameraError:
    """Reason why a source could not be opened, as far as known."""
    if spec.kind is SourceKind.VIDEO:
        return CameraError(f"{spec.place} cannot be read", "a video file, or a PNG or JPEG")
    if spec.kind is SourceKind.STREAM:
        return SourceLostError(
            f"the stream {spec.shown} cannot be opened", "an address that a player can open"
        )
    if spec.kind is SourceKind.GSTREAMER:
        return SourceLostError(
            f"the GStreamer pipeline {spec.shown!r} does not start",
            "one that ends in: videoconvert ! video/x-raw,format=BGR ! appsink drop=true",
        )
    device = Path(spec.place)
    if not device.exists():
        return SourceLostError(f"there is no camera {device}", "one that is plugged in")
    if not os.access(device, os.R_OK | os.W_OK):
        return SourceLostError(f"{device} may not be used", "a user in the group 'video'")
    return SourceLostError(f"{device} cannot be opened", "a camera that no other program uses")
