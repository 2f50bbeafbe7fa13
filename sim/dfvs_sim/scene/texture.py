"""Colour images of a scene as mip pyramids, packed into one array for the renderer."""

from collections.abc import Sequence
from dataclasses import dataclass
from enum import IntEnum
from typing import TypeAlias

import cv2
import numpy as np
from numpy.typing import NDArray

from dfvs_core.errors import ImageError
from dfvs_core.geometry.arrays import Float32Array, ImageArray

MAX_LEVELS = 14
MAX_TEXTURE_SIDE_PX = 4096

Int64Array: TypeAlias = NDArray[np.int64]


class Wrap(IntEnum):
    """What lies beyond the edge of a texture."""

    REPEAT = 0
    CLAMP = 1
    MIRROR = 2


@dataclass(frozen=True, slots=True)
class Texture:
    """One image, sRGB, with its first row at v = 0 (glTF's convention)."""

    image: ImageArray
    """(H, W, 3) uint8: RGB, sRGB encoded."""
    wrap_u: Wrap = Wrap.REPEAT
    wrap_v: Wrap = Wrap.REPEAT
    """What lies beyond the upper and lower edge, as ``wrap_u`` beyond the others."""

    def __post_init__(self) -> None:
        """Refuse what is not an RGB image."""
        if self.image.ndim != 3 or self.image.shape[2] != 3 or self.image.dtype != np.uint8:
            raise ImageError(
                f"texture is {self.image.dtype} of shape {self.image.shape}", "uint8 of (H, W, 3)"
            )
        if self.image.shape[0] < 1 or self.image.shape[1] < 1:
            raise ImageError(f"texture of shape {self.image.shape} is empty")


@dataclass(frozen=True, slots=True, eq=False)
class TexturePack:
    """All textures of a scene, every mip level, end to end."""

    texels: ImageArray
    """(P * 3,) uint8: RGB, sRGB encoded; levels one after the other, row by row."""
    levels: Int64Array
    """(K, MAX_LEVELS, 5) int64: first texel, width and height of each level of each texture, and
    its ``Wrap`` of u and v. Beyond the smallest level that one is repeated.
    """


def linear_from_srgb(srgb: Float32Array) -> Float32Array:
    """Linear light of sRGB values, both in 0 to 1 (IEC 61966-2-1)."""
    srgb = np.asarray(srgb, dtype=np.float32)
    low = srgb / 12.92
    high = ((srgb + 0.055) / 1.055) ** 2.4
    return np.where(srgb <= 0.04045, low, high).astype(np.float32)


def srgb_from_linear(linear: Float32Array) -> Float32Array:
    """SRGB values of linear light, both in 0 to 1 (IEC 61966-2-1)."""
    linear = np.clip(np.asarray(linear, dtype=np.float32), 0.0, 1.0)
    low = linear * 12.92
    high = 1.055 * linear ** (1.0 / 2.4) - 0.055
    return np.where(linear <= 0.0031308, low, high).astype(np.float32)


def mip_pyramid(image: ImageArray) -> list[ImageArray]:
    """Levels of a texture (H, W, 3) uint8 sRGB, each half the one before, averaged as light."""
    side = max(image.shape[:2])
    if side > MAX_TEXTURE_SIDE_PX:
        scale = MAX_TEXTURE_SIDE_PX / side
        image = np.asarray(
            cv2.resize(image, None, fx=scale, fy=scale, interpolation=cv2.INTER_AREA), np.uint8
        )
    decode = linear_from_srgb(np.arange(256, dtype=np.float32) / 255.0)
    light = decode[image]
    levels = [np.ascontiguousarray(image)]
    while max(light.shape[:2]) > 1 and len(levels) < MAX_LEVELS:
        height, width = max(1, light.shape[0] // 2), max(1, light.shape[1] // 2)
        light = np.asarray(
            cv2.resize(light, (width, height), interpolation=cv2.INTER_AREA), np.float32
        ).reshape(height, width, 3)
        levels.append(np.rint(srgb_from_linear(light) * 255.0).astype(np.uint8))
    return levels


def pack_textures(textures: Sequence[Texture]) -> TexturePack:
    """Build the mip pyramids of all textures and lay them end to end."""
    levels = np.zeros((max(len(textures), 1), MAX_LEVELS, 5), np.int64)
    chunks: list[ImageArray] = []
    first = 0
    for k, texture in enumerate(textures):
        for n, level in enumerate(mip_pyramid(texture.image)):
            height, width = level.shape[:2]
            levels[k, n:] = (first, width, height, texture.wrap_u, texture.wrap_v)
            first += width * height
            chunks.append(level.reshape(-1))
    texels = np.concatenate(chunks) if chunks else np.zeros(3, np.uint8)
    return TexturePack(texels, levels)
