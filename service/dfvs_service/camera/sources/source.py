"""Interface of image sources, their opening by a specification, and images as a source."""

import time
from dataclasses import dataclass
from pathlib import Path
from typing import Protocol

from dfvs_core.geometry.arrays import ImageArray
from dfvs_service.camera.sources.spec import CameraError, SourceKind, SourceSpec
from dfvs_service.frames import CapturedImage
from dfvs_service.settings.goal_file import images_in, read_image


@dataclass(frozen=True, slots=True)
class SourceOptions:
    """How a source is to be opened.

    ``size`` (width, height) px and ``rate_hz`` are asked of a camera where they are not None.
    ``latency_ns`` is what is known to pass between capture and arrival where a source does not
    give the time of capture (see ``STAMPED_ON_ARRIVAL``).
    """

    size: tuple[int, int] | None = None
    rate_hz: float | None = None
    latency_ns: int = 0


class Source(Protocol):
    """An open source."""

    rate_hz: float
    """Images a second that it reports; 0 where it reports none."""

    def read(self) -> CapturedImage | None:
        """Wait for the next image; None at the end of a recording.

        Raises
        ------
        SourceLostError
            If a live source gives no more images.
        CameraError
            If what it gives cannot be used.
        """

    def close(self) -> None:
        """Give the device or file back."""


def image_paths(place: str) -> list[Path]:
    """Images of a folder, see :func:`images_in`, or the one image that is named.

    Raises
    ------
    CameraError
        If there are none.
    """
    path = Path(place)
    if path.is_file():
        return [path]
    paths = images_in(path)
    if not paths:
        raise CameraError(f"there are no images in {place}", "PNG or JPEG files")
    return paths


class ImageSource:
    """Images, one after the other; their capture time is when they are read."""

    rate_hz = 0.0

    def __init__(self, place: str) -> None:
        self._waiting = image_paths(place)[::-1]

    def read(self) -> CapturedImage | None:
        """Next image, None after the last one."""
        if not self._waiting:
            return None
        return CapturedImage(read_image(self._waiting.pop()), time.monotonic_ns())

    def close(self) -> None:
        """Nothing is open between two images."""


def open_source(spec: SourceSpec, options: SourceOptions) -> Source:
    """Open a source.

    Raises
    ------
    SourceLostError
        If a live source cannot be reached right now.
    CameraError
        If it can never be opened like this.
    """
    if spec.kind is SourceKind.PICAMERA:
        from dfvs_service.camera.sources.picamera import PicameraSource

        return PicameraSource(int(spec.place), options)
    if spec.kind is SourceKind.IMAGES:
        return ImageSource(spec.place)
    from dfvs_service.camera.sources.capture import CaptureSource

    return CaptureSource(spec, options)


def check_size(image: ImageArray, wanted: tuple[int, int] | None, who: str) -> tuple[int, int]:
    """Size (width, height) px of an image, which must be the wanted one where that is not None.

    Raises
    ------
    CameraError
        If it has another size.
    """
    height, width = image.shape[:2]
    if wanted is not None and (width, height) != wanted:
        raise CameraError(
            f"{who} gives {width} x {height} px",
            f"{wanted[0]} x {wanted[1]} px, as --size, the calibration or the images before say",
            "choose a size that the camera has, and keep to it",
        )
    return width, height
