"""Lens distortion: which pinhole image covers a distorted camera, and where its pixels lie."""

from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from dfvs_core.errors import GeometryError
from dfvs_core.geometry.arrays import Float32Array
from dfvs_core.geometry.camera import CameraModel

_WIDEST = float(np.tan(np.radians(70.0)))
_ROUND_TRIP_PX = 0.05
_MARGIN_PX = 2.0


@dataclass(frozen=True, slots=True, eq=False)
class Lens:
    """A pinhole camera that sees all that a distorted one sees."""

    pinhole: CameraModel
    """Same axes and focal lengths, larger image."""
    x: Float32Array
    y: Float32Array
    """Both (H, W) float32: position in the pinhole image of each pixel's centre."""


@lru_cache(maxsize=8)
def lens_of(camera: CameraModel) -> Lens:
    """Work out the pinhole image behind a distorted camera (kept for the next frame).

    Raises
    ------
    GeometryError
        If the distortion cannot be inverted all over the image, or reaches beyond 70 degrees
        from the optical axis.
    """
    pixels = camera.grid()
    xy = camera.normalise(pixels)
    if not np.isfinite(xy).all() or np.abs(camera.denormalise(xy) - pixels).max() > _ROUND_TRIP_PX:
        raise GeometryError(
            f"distortion {camera.distortion} cannot be inverted all over the image",
            "coefficients that hold up to the corners of the image",
        )
    low, high = xy.min(axis=(0, 1)), xy.max(axis=(0, 1))
    if max(-low.min(), high.max()) > _WIDEST:
        raise GeometryError(
            f"the distorted camera sees {np.degrees(np.arctan(np.abs(xy).max())):.0f} degrees "
            "from its axis",
            "at most 70 degrees",
        )
    focal = np.array([camera.fx, camera.fy])
    centre = np.ceil(-low * focal + _MARGIN_PX)
    width, height = (int(n) for n in np.ceil(high * focal + centre + _MARGIN_PX))
    pinhole = CameraModel(width, height, camera.fx, camera.fy, float(centre[0]), float(centre[1]))
    x, y = np.moveaxis(pinhole.denormalise(xy), -1, 0).astype(np.float32)
    return Lens(pinhole, x, y)
