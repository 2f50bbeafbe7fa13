"""Image source of one image or a folder of images in the order of their names."""

import time
from pathlib import Path

from dfvs_core.errors import ImageError
from dfvs_core.messages.image import MAX_IMAGE_BYTES, decode_image
from dfvs_service.camera.sources.spec import CameraError
from dfvs_service.frames import CapturedImage
from dfvs_service.settings.goal_file import is_image


def image_paths(place: str) -> list[Path]:
    """Images of a folder in the order of their names, or the one image that is named.

    Raises
    ------
    CameraError
        If there are none.
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
        path = self._waiting.pop()
        try:
            with path.open("rb") as file:
                image = decode_image(file.read(MAX_IMAGE_BYTES + 1))
        except OSError as error:
            raise CameraError(f"cannot read {path} ({error.strerror})") from error
        except ImageError as error:
            raise CameraError(f"the image {path} cannot be used: {error}") from error
        return CapturedImage(image, time.monotonic_ns())

    def close(self) -> None:
        """Nothing is open between two images."""
