"""Specification of an image source: the argument of ``--source``."""

import enum
import re
from dataclasses import dataclass
from pathlib import Path

from dfvs_core.errors import DfvsError
from dfvs_service.settings.goal_file import is_image

_DEVICES = "/dev/"
_PICAMERA = re.compile(r"picamera2?(?::(\d+))?")
_URL = re.compile(r"[a-z][a-z0-9+.-]*://", re.IGNORECASE)
_PASSWORD = re.compile(r'(://[^/\s:]*:)[^/\s]*(?=@)|(\buser-pw=)("[^"]*"|\S+)')


class CameraError(DfvsError):
    """A camera, stream or file that cannot be used as asked: trying again would not help."""


class SourceLostError(DfvsError):
    """A live source that cannot be reached right now: trying again may help."""


class SourceKind(enum.StrEnum):
    """Where images can come from."""

    V4L2 = "V4L2 device"
    STREAM = "stream"
    GSTREAMER = "GStreamer pipeline"
    PICAMERA = "Picamera2"
    VIDEO = "video file"
    IMAGES = "pictures"


LIVE = frozenset({SourceKind.V4L2, SourceKind.STREAM, SourceKind.GSTREAMER, SourceKind.PICAMERA})
STAMPED_ON_ARRIVAL = LIVE - {SourceKind.PICAMERA}
"""Where images have no time of capture; a V4L2 driver may give one."""


@dataclass(frozen=True, slots=True)
class SourceSpec:
    """A source: its kind, and the device, URL, pipeline, number of a Pi's camera, or path."""

    kind: SourceKind
    place: str

    @property
    def is_live(self) -> bool:
        """Whether images come at their own pace, and may come back after a loss."""
        return self.kind in LIVE

    @property
    def shown(self) -> str:
        """The place as logs and errors may show it: without the password of a URL or rtspsrc."""
        return _PASSWORD.sub(r"\1\2***", self.place)

    def __str__(self) -> str:
        return f"{self.kind} {self.shown}"


def parse_source(text: str) -> SourceSpec:
    """Kind of source that a word of the command line names.

    Raises
    ------
    CameraError
        If it is none of them, or may not be read.
    """
    if text.isdecimal():
        return SourceSpec(SourceKind.V4L2, f"{_DEVICES}video{text}")
    if match := _PICAMERA.fullmatch(text):
        return SourceSpec(SourceKind.PICAMERA, match[1] or "0")
    if text.startswith("gst:") or " ! " in text:
        return SourceSpec(SourceKind.GSTREAMER, text.removeprefix("gst:").strip())
    if _URL.match(text):
        return SourceSpec(SourceKind.STREAM, text)
    path = Path(text)
    try:
        is_folder, is_file = path.is_dir(), path.is_file()
    except OSError as error:
        raise CameraError(f"the source {text[:200]!r} cannot be read ({error.strerror})") from error
    if is_folder or (is_file and is_image(path)):
        return SourceSpec(SourceKind.IMAGES, text)
    if is_file:
        return SourceSpec(SourceKind.VIDEO, text)
    if text.startswith(_DEVICES):
        return SourceSpec(SourceKind.V4L2, text)
    raise CameraError(
        f"there is no source {text!r}",
        "a device (0, /dev/video0, /dev/v4l/by-id/...), URL (rtsp://...), GStreamer pipeline "
        "(gst:...), picamera, or an existing video, image or folder of images",
    )
