"""Image source of one image or a folder of images in the order of their names."""

import time
from pathlib import Path

from dfvs_service.camera.sources.spec import CameraError
from dfvs_service.frames import CapturedImage
from dfvs_service.settings.goal_file import is_image, read_image


def image_paths(place: str) -> list[Path]:
    """Images of a folder in the order of their names, or the one image that is named.

    Raises CameraError if there are none.
    """
    path = Path(place)
    if path.is_file():
        return [path]
    paths = sorted(p for p in path.iterdir() if is_image(p))
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
