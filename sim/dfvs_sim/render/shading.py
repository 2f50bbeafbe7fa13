"""Colour of the pixels, once it is known which triangle each one sees (numba).

Every attribute f is interpolated as f = (F . p) / (S . p), with F = sum e_i f_i and S = sum e_i
over the edge functions e_i: perspective-correct, and its screen derivatives come for free, which
choose the mip level and the direction of the anisotropic samples.
"""

from __future__ import annotations

import math
from typing import TypeAlias

import numpy as np
from numba import njit

from dfvs_core.arrays import Float32Array, FloatArray, ImageArray
from dfvs_sim.render.geometry import edge_functions
from dfvs_sim.scene.mesh import Int32Array
from dfvs_sim.scene.texture import Int64Array

Mesh: TypeAlias = tuple[FloatArray, Int32Array, Float32Array, Float32Array, Int32Array]
"""Vertices as (X, Y, W), triangles, uv, vertex colours, texture of each triangle."""
Pack: TypeAlias = tuple[ImageArray, Int64Array, Int64Array, Int64Array, Float32Array]
"""Texels, levels, level counts, wrap modes (``TexturePack``), and the sRGB decoding table."""
Colours: TypeAlias = tuple[FloatArray, ImageArray]
"""Sky (3,) in linear light, and the sRGB encoding table over 0 to 1."""

MAX_ANISOTROPY = 4
_CLAMP, _MIRROR = 1, 2


@njit(cache=True, nogil=True)
def wrap_coordinate(u: float, mode: int) -> float:
    """Texture coordinate taken to [0, 1] by repeating, clamping or mirroring."""
    if mode == _CLAMP:
        return min(max(u, 0.0), 1.0)
    if mode == _MIRROR:
        u -= 2.0 * math.floor(0.5 * u)
        return 2.0 - u if u > 1.0 else u
    return u - math.floor(u)


@njit(cache=True, nogil=True)
def neighbour_texels(x: float, size: int, mode: int) -> tuple[int, int, float]:
    """Two texels around x (in texels, 0 .. size) and the weight of the second."""
    x -= 0.5
    floor = math.floor(x)
    fraction = x - floor
    first = int(floor)
    second = first + 1
    if mode == 0:
        if first < 0:
            first += size
        if second >= size:
            second -= size
    else:
        first = max(first, 0)
        second = min(second, size - 1)
    return first, second, fraction


@njit(cache=True, nogil=True)
def bilinear(
    pack: Pack, k: int, level: int, u: float, v: float
) -> tuple[float, float, float]:
    """Linear light of one mip level of texture k at (u, v)."""
    texels, levels, _, wrap, decode = pack
    first, width, height = levels[k, level, 0], levels[k, level, 1], levels[k, level, 2]
    mode_u, mode_v = wrap[k, 0], wrap[k, 1]
    i0, i1, fx = neighbour_texels(wrap_coordinate(u, mode_u) * width, width, mode_u)
    j0, j1, fy = neighbour_texels(wrap_coordinate(v, mode_v) * height, height, mode_v)
    a, b = 3 * (first + j0 * width + i0), 3 * (first + j0 * width + i1)
    c, d = 3 * (first + j1 * width + i0), 3 * (first + j1 * width + i1)
    wa, wb, wc, wd = (1.0 - fx) * (1.0 - fy), fx * (1.0 - fy), (1.0 - fx) * fy, fx * fy
    red = wa * decode[texels[a]] + wb * decode[texels[b]]
    green = wa * decode[texels[a + 1]] + wb * decode[texels[b + 1]]
    blue = wa * decode[texels[a + 2]] + wb * decode[texels[b + 2]]
    red += wc * decode[texels[c]] + wd * decode[texels[d]]
    green += wc * decode[texels[c + 1]] + wd * decode[texels[d + 1]]
    blue += wc * decode[texels[c + 2]] + wd * decode[texels[d + 2]]
    return red, green, blue


@njit(cache=True, nogil=True)
def sample_texture(
    pack: Pack,
    k: int,
    uv: tuple[float, float],
    along_x: tuple[float, float],
    along_y: tuple[float, float],
) -> tuple[float, float, float]:
    """Linear light of texture k over a pixel's footprint.

    uv is the pixel's centre; along_x and along_y are how far (u, v) move per pixel.
    """
    width, height = pack[1][k, 0, 1], pack[1][k, 0, 2]
    major = math.hypot(along_x[0] * width, along_x[1] * height)
    minor = math.hypot(along_y[0] * width, along_y[1] * height)
    du, dv = along_x
    if major < minor:
        major, minor = minor, major
        du, dv = along_y
    taps = 1
    if major > 1.0:
        ratio = major / max(minor, 1e-9)
        taps = max(1, int(min(math.ceil(ratio - 0.25), float(MAX_ANISOTROPY))))
    lod = min(math.log2(max(major / taps, 1.0)), float(pack[2][k] - 1))
    level = int(lod)
    fraction = lod - level
    red, green, blue = 0.0, 0.0, 0.0
    for n in range(taps):
        offset = (n + 0.5) / taps - 0.5
        u, v = uv[0] + offset * du, uv[1] + offset * dv
        r, g, b = bilinear(pack, k, level, u, v)
        if fraction > 0.0:
            r1, g1, b1 = bilinear(pack, k, level + 1, u, v)
            r += fraction * (r1 - r)
            g += fraction * (g1 - g)
            b += fraction * (b1 - b)
        red, green, blue = red + r, green + g, blue + b
    return red / taps, green / taps, blue / taps


@njit(cache=True, nogil=True)
def prepare_triangle(
    mesh: Mesh,
    t: int,
    e: FloatArray,
    F: FloatArray,
) -> None:
    """Write S, then U, V and the three colours, each (3,), to F (6, 3) for triangle t."""
    clip, triangles, uv, colours, _ = mesh
    edge_functions(clip, triangles[t, 0], triangles[t, 1], triangles[t, 2], e)
    for k in range(3):
        for a in range(6):
            F[a, k] = 0.0
        for i in range(3):
            vertex = triangles[t, i]
            F[0, k] += e[i, k]
            F[1, k] += e[i, k] * uv[vertex, 0]
            F[2, k] += e[i, k] * uv[vertex, 1]
            for n in range(3):
                F[3 + n, k] += e[i, k] * colours[vertex, n]


@njit(cache=True, nogil=True)
def shade_point(
    mesh: Mesh, pack: Pack, t: int, F: FloatArray, xy: tuple[float, float]
) -> tuple[float, float, float]:
    """Linear light of triangle t at pixel position xy, over a footprint one pixel wide."""
    x, y = xy
    w = 1.0 / (F[0, 0] * x + F[0, 1] * y + F[0, 2])
    red = max((F[3, 0] * x + F[3, 1] * y + F[3, 2]) * w, 0.0)
    green = max((F[4, 0] * x + F[4, 1] * y + F[4, 2]) * w, 0.0)
    blue = max((F[5, 0] * x + F[5, 1] * y + F[5, 2]) * w, 0.0)
    k = mesh[4][t]
    if k < 0:
        return red, green, blue
    u = (F[1, 0] * x + F[1, 1] * y + F[1, 2]) * w
    v = (F[2, 0] * x + F[2, 1] * y + F[2, 2]) * w
    along_x = ((F[1, 0] - u * F[0, 0]) * w, (F[2, 0] - v * F[0, 0]) * w)
    along_y = ((F[1, 1] - u * F[0, 1]) * w, (F[2, 1] - v * F[0, 1]) * w)
    r, g, b = sample_texture(pack, k, (u, v), along_x, along_y)
    return red * r, green * g, blue * b


@njit(cache=True, nogil=True)
def encoded(light: float, encode: ImageArray) -> int:
    """SRGB code of linear light, through a table over 0 to 1."""
    return encode[int(min(light, 1.0) * (encode.shape[0] - 1) + 0.5)]


@njit(cache=True, nogil=True)
def shade(
    mesh: Mesh, pack: Pack, ids: Int32Array, colours: Colours, image: ImageArray
) -> None:
    """Colour an image (H, W, 3) from triangle ids (H, W), one sample at each pixel's centre."""
    sky, encode = colours
    e, F = np.empty((3, 3)), np.empty((6, 3))
    prepared = -1
    for j in range(ids.shape[0]):
        for i in range(ids.shape[1]):
            t = ids[j, i]
            red, green, blue = sky[0], sky[1], sky[2]
            if t >= 0:
                if t != prepared:
                    prepare_triangle(mesh, t, e, F)
                    prepared = t
                red, green, blue = shade_point(mesh, pack, t, F, (i + 0.5, j + 0.5))
            image[j, i, 0] = encoded(red, encode)
            image[j, i, 1] = encoded(green, encode)
            image[j, i, 2] = encoded(blue, encode)


@njit(cache=True, nogil=True)
def coverage(ids: Int32Array, a: int) -> tuple[int, float, float]:
    """How many of the samples (2, 2) see the same triangle as sample a, and their mean place.

    0 if an earlier sample sees it too.
    """
    seen, x, y = 0, 0.0, 0.0
    for b in range(4):
        if ids[b // 2, b % 2] == ids[a // 2, a % 2]:
            if b < a:
                return 0, 0.0, 0.0
            seen += 1
            x += 0.25 + 0.5 * (b % 2)
            y += 0.25 + 0.5 * (b // 2)
    return seen, x / seen, y / seen


@njit(cache=True, nogil=True)
def shade_antialiased(
    mesh: Mesh, pack: Pack, ids: Int32Array, colours: Colours, image: ImageArray
) -> None:
    """Colour an image (H, W, 3) from ids (2H, 2W): 2 x 2 coverage samples a pixel.

    A triangle seen by several of the four samples is shaded once, at their mean position, with a
    footprint of one whole pixel; light is averaged, not its sRGB code.
    """
    sky, encode = colours
    e, F = np.empty((3, 3)), np.empty((6, 3))
    prepared = -1
    for j in range(image.shape[0]):
        for i in range(image.shape[1]):
            samples = ids[2 * j : 2 * j + 2, 2 * i : 2 * i + 2]
            red, green, blue = 0.0, 0.0, 0.0
            for a in range(4):
                seen, x, y = coverage(samples, a)
                t = samples[a // 2, a % 2]
                if seen == 0:
                    continue
                r, g, b = sky[0], sky[1], sky[2]
                if t >= 0:
                    if t != prepared:
                        prepare_triangle(mesh, t, e, F)
                        prepared = t
                    r, g, b = shade_point(mesh, pack, t, F, (i + x, j + y))
                red += 0.25 * seen * min(r, 1.0)
                green += 0.25 * seen * min(g, 1.0)
                blue += 0.25 * seen * min(b, 1.0)
            image[j, i, 0] = encoded(red, encode)
            image[j, i, 1] = encoded(green, encode)
            image[j, i, 2] = encoded(blue, encode)
