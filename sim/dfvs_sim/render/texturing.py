"""Linear light of a texture over the footprint of a pixel: mip levels, anisotropic (numba).

All functions are inlined into their callers.
"""

import math
from typing import TypeAlias

import numpy as np
from numba import njit

from dfvs_core.geometry.arrays import FloatArray, ImageArray
from dfvs_sim.scene.texture import MAX_LEVELS, Int64Array, Wrap

Light: TypeAlias = tuple[float, float, float]
"""Red, green and blue in linear light."""
Footprint: TypeAlias = tuple[float, float, float, float, int, float]
"""Where a pixel looks at a texture: u, v, their spread du, dv, samples to take, mip level."""

MAX_ANISOTROPY = 4
_FARTHEST_UV = 1e6
_SOFTNESS = 0.5  # mip levels; a lens blurs about as much, and textures do not shimmer in flight
_LEVEL_BLEND = 2.0  # blend two mip levels only around the middle between them: one is faster
_REPEAT, _CLAMP = int(Wrap.REPEAT), int(Wrap.CLAMP)
_G, _B = np.uint64(1), np.uint64(2)


@njit(inline="always")
def neighbour_texels(u: float, size: int, mode: int) -> tuple[int, int, float]:
    """Two texels around u, of ``size`` along the texture, and the weight of the second."""
    x = u * size - 0.5
    floor = math.floor(x)
    first = int(floor)
    second = first + 1
    if mode == _REPEAT:
        if size & (size - 1) == 0:
            first &= size - 1
            second &= size - 1
        else:
            first %= size
            second %= size
    elif mode == _CLAMP:
        first = min(max(first, 0), size - 1)
        second = min(max(second, 0), size - 1)
    else:
        first %= 2 * size
        second %= 2 * size
        first = min(first, 2 * size - 1 - first)
        second = min(second, 2 * size - 1 - second)
    return first, second, x - floor


@njit(inline="always")
def bilinear(
    texels: ImageArray,
    decode: FloatArray,
    levels: Int64Array,
    place: tuple[int, int],
    uv: tuple[float, float],
) -> Light:
    """Linear light at uv of one mip level, place = (texture, level).

    The indices are unsigned: numba would check signed ones for being negative.
    """
    k, n = place
    first, width, height = levels[k, n, 0], levels[k, n, 1], levels[k, n, 2]
    i0, i1, fx = neighbour_texels(uv[0], width, levels[k, n, 3])
    j0, j1, fy = neighbour_texels(uv[1], height, levels[k, n, 4])
    top, bottom = first + j0 * width, first + j1 * width
    a, b = np.uint64(3 * (top + i0)), np.uint64(3 * (top + i1))
    c, d = np.uint64(3 * (bottom + i0)), np.uint64(3 * (bottom + i1))
    wb, wd = fx * (1.0 - fy), fx * fy
    wa, wc = 1.0 - fy - wb, fy - wd
    red = wa * decode[texels[a]] + wb * decode[texels[b]]
    green = wa * decode[texels[a + _G]] + wb * decode[texels[b + _G]]
    blue = wa * decode[texels[a + _B]] + wb * decode[texels[b + _B]]
    red += wc * decode[texels[c]] + wd * decode[texels[d]]
    green += wc * decode[texels[c + _G]] + wd * decode[texels[d + _G]]
    blue += wc * decode[texels[c + _B]] + wd * decode[texels[d + _B]]
    return red, green, blue


@njit(inline="always")
def footprint(
    uv: tuple[float, float],
    along_x: tuple[float, float],
    along_y: tuple[float, float],
    size: tuple[int, int],
) -> Footprint:
    """How to sample a texture of ``size`` texels for one pixel.

    along_x and along_y are how far (u, v) move per pixel. A long footprint takes several samples
    of a finer level along its longer axis.
    """
    u, v = uv
    du, dv = along_x
    width, height = size
    major = (du * width) ** 2 + (dv * height) ** 2
    minor = (along_y[0] * width) ** 2 + (along_y[1] * height) ** 2
    if major < minor:
        major, minor = minor, major
        du, dv = along_y
    if not (abs(u) < _FARTHEST_UV and abs(v) < _FARTHEST_UV and major < _FARTHEST_UV**2):
        return 0.5, 0.5, 0.0, 0.0, 1, MAX_LEVELS - 2.0
    if major <= 0.5:
        return u, v, du, dv, 1, 0.0
    taps = 1
    if major > 1.5**2 * minor:
        taps = 2
    if major > 2.5**2 * minor:
        taps = 3
    if major > 3.5**2 * minor:
        taps = MAX_ANISOTROPY
    lod = 0.5 * math.log2(major / (taps * taps)) + _SOFTNESS
    return u, v, du, dv, taps, min(max(lod, 0.0), MAX_LEVELS - 2.0)


@njit(inline="always")
def sample_texture(
    texels: ImageArray, decode: FloatArray, levels: Int64Array, k: int, area: Footprint
) -> Light:
    """Linear light of texture k over a footprint."""
    u, v, du, dv, taps, lod = area
    n = int(lod)
    fraction = min(max((lod - n) * _LEVEL_BLEND + 0.5 * (1.0 - _LEVEL_BLEND), 0.0), 1.0)
    if fraction == 1.0:
        n, fraction = n + 1, 0.0
    weight = 1.0 / taps
    red, green, blue = 0.0, 0.0, 0.0
    for tap in range(taps):
        offset = (tap + 0.5) * weight - 0.5
        at = (u + offset * du, v + offset * dv)
        r, g, b = bilinear(texels, decode, levels, (k, n), at)
        if fraction > 0.0:
            r1, g1, b1 = bilinear(texels, decode, levels, (k, n + 1), at)
            r += fraction * (r1 - r)
            g += fraction * (g1 - g)
            b += fraction * (b1 - b)
        red, green, blue = red + r, green + g, blue + b
    return red * weight, green * weight, blue * weight
