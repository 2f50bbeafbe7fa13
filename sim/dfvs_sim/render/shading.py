"""Colour of the pixels, once it is known which triangle each one sees (numba).

Every attribute f is interpolated as f = (F . p) / (S . p), with F = sum e_i f_i and S = sum e_i
over the edge functions e_i: perspective-correct, and its screen derivatives come for free, which
choose the mip level and the direction of the anisotropic samples.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from dfvs_core.arrays import Float32Array, FloatArray, ImageArray
from dfvs_sim.render.geometry import edge_functions
from dfvs_sim.scene.mesh import Int32Array
from dfvs_sim.scene.texture import Int64Array

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
def add_bilinear(
    pack: tuple[ImageArray, Int64Array, Int64Array, Int64Array, Float32Array],
    place: tuple[int, int],
    u: float,
    v: float,
    weight: float,
    out: FloatArray,
) -> None:
    """Add weight x the linear light of one mip level, place = (texture, level), at (u, v)."""
    texels, levels, _, wrap, decode = pack
    k, level = place
    first, width, height = levels[k, level, 0], levels[k, level, 1], levels[k, level, 2]
    u = wrap_coordinate(u, wrap[k, 0])
    v = wrap_coordinate(v, wrap[k, 1])
    i0, i1, fx = neighbour_texels(u * width, width, wrap[k, 0])
    j0, j1, fy = neighbour_texels(v * height, height, wrap[k, 1])
    a, b = 3 * (first + j0 * width + i0), 3 * (first + j0 * width + i1)
    c, d = 3 * (first + j1 * width + i0), 3 * (first + j1 * width + i1)
    wa, wb = weight * (1.0 - fx) * (1.0 - fy), weight * fx * (1.0 - fy)
    wc, wd = weight * (1.0 - fx) * fy, weight * fx * fy
    for n in range(3):
        out[n] += (
            wa * decode[texels[a + n]]
            + wb * decode[texels[b + n]]
            + wc * decode[texels[c + n]]
            + wd * decode[texels[d + n]]
        )


@njit(cache=True, nogil=True)
def sample_texture(
    pack: tuple[ImageArray, Int64Array, Int64Array, Int64Array, Float32Array],
    k: int,
    uv: FloatArray,
    out: FloatArray,
) -> None:
    """Write the linear light (3,) of texture k over a pixel's footprint to ``out``.

    uv : (6,) float64 holds u, v, du/dx, dv/dx, du/dy, dv/dy, the last four per pixel.
    """
    width, height = pack[1][k, 0, 1], pack[1][k, 0, 2]
    along_x = math.hypot(uv[2] * width, uv[3] * height)
    along_y = math.hypot(uv[4] * width, uv[5] * height)
    if along_x >= along_y:
        major, minor, du, dv = along_x, along_y, uv[2], uv[3]
    else:
        major, minor, du, dv = along_y, along_x, uv[4], uv[5]
    taps = 1
    if major > 1.0:
        ratio = major / max(minor, 1e-9)
        taps = int(min(math.ceil(ratio - 0.25), float(MAX_ANISOTROPY)))
        taps = max(taps, 1)
    lod = math.log2(max(major / taps, 1.0))
    lod = min(lod, float(pack[2][k] - 1))
    level = int(lod)
    fraction = lod - level
    out[0] = out[1] = out[2] = 0.0
    for n in range(taps):
        offset = (n + 0.5) / taps - 0.5
        u, v = uv[0] + offset * du, uv[1] + offset * dv
        add_bilinear(pack, (k, level), u, v, (1.0 - fraction) / taps, out)
        if fraction > 0.0:
            add_bilinear(pack, (k, level + 1), u, v, fraction / taps, out)


@njit(cache=True, nogil=True)
def prepare_triangle(
    mesh: tuple[FloatArray, Int32Array, Float32Array, Float32Array, Int32Array],
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
    mesh: tuple[FloatArray, Int32Array, Float32Array, Float32Array, Int32Array],
    pack: tuple[ImageArray, Int64Array, Int64Array, Int64Array, Float32Array],
    t: int,
    F: FloatArray,
    xy: tuple[float, float],
    scratch: FloatArray,
) -> None:
    """Write the linear light of triangle t at pixel position xy to scratch[:3].

    scratch : (12,) float64. The footprint is one pixel wide.
    """
    x, y = xy
    w = 1.0 / (F[0, 0] * x + F[0, 1] * y + F[0, 2])
    k = mesh[4][t]
    if k >= 0:
        for a in range(2):
            value = (F[1 + a, 0] * x + F[1 + a, 1] * y + F[1 + a, 2]) * w
            scratch[6 + a] = value
            scratch[8 + a] = (F[1 + a, 0] - value * F[0, 0]) * w
            scratch[10 + a] = (F[1 + a, 1] - value * F[0, 1]) * w
        sample_texture(pack, k, scratch[6:12], scratch[:3])
    else:
        scratch[0] = scratch[1] = scratch[2] = 1.0
    for n in range(3):
        light = (F[3 + n, 0] * x + F[3 + n, 1] * y + F[3 + n, 2]) * w
        scratch[n] *= min(max(light, 0.0), 1e6)


@njit(cache=True, nogil=True)
def encode_pixel(light: FloatArray, encode: ImageArray, pixel: ImageArray) -> None:
    """Write linear light (3,) as sRGB through the table ``encode``, its last entry being 1."""
    top = encode.shape[0] - 1
    for n in range(3):
        pixel[n] = encode[int(min(max(light[n], 0.0), 1.0) * top + 0.5)]


@njit(cache=True, nogil=True)
def shade(
    mesh: tuple[FloatArray, Int32Array, Float32Array, Float32Array, Int32Array],
    pack: tuple[ImageArray, Int64Array, Int64Array, Int64Array, Float32Array],
    ids: Int32Array,
    sky: FloatArray,
    encode: ImageArray,
    image: ImageArray,
) -> None:
    """Colour an image (H, W, 3) from triangle ids (H, W), one sample at each pixel's centre."""
    e, F, scratch = np.empty((3, 3)), np.empty((6, 3)), np.empty(12)
    prepared = -1
    for j in range(ids.shape[0]):
        for i in range(ids.shape[1]):
            t = ids[j, i]
            if t < 0:
                encode_pixel(sky, encode, image[j, i])
                continue
            if t != prepared:
                prepare_triangle(mesh, t, e, F)
                prepared = t
            shade_point(mesh, pack, t, F, (i + 0.5, j + 0.5), scratch)
            encode_pixel(scratch, encode, image[j, i])


@njit(cache=True, nogil=True)
def shade_antialiased(
    mesh: tuple[FloatArray, Int32Array, Float32Array, Float32Array, Int32Array],
    pack: tuple[ImageArray, Int64Array, Int64Array, Int64Array, Float32Array],
    ids: Int32Array,
    sky: FloatArray,
    encode: ImageArray,
    image: ImageArray,
) -> None:
    """Colour an image (H, W, 3) from ids (2H, 2W): 2 x 2 coverage samples a pixel.

    A triangle seen by several of the four samples is shaded once, at their mean position, with a
    footprint of one whole pixel; light is averaged, not its sRGB code.
    """
    e, F, scratch, total = np.empty((3, 3)), np.empty((6, 3)), np.empty(12), np.empty(3)
    prepared = -1
    for j in range(image.shape[0]):
        for i in range(image.shape[1]):
            total[:] = 0.0
            for a in range(4):
                t = ids[2 * j + a // 2, 2 * i + a % 2]
                seen, x, y = 0, 0.0, 0.0
                repeated = False
                for b in range(4):
                    if ids[2 * j + b // 2, 2 * i + b % 2] == t:
                        repeated = repeated or b < a
                        seen += 1
                        x += 0.25 + 0.5 * (b % 2)
                        y += 0.25 + 0.5 * (b // 2)
                if repeated:
                    continue
                if t >= 0:
                    if t != prepared:
                        prepare_triangle(mesh, t, e, F)
                        prepared = t
                    shade_point(mesh, pack, t, F, (i + x / seen, j + y / seen), scratch)
                for n in range(3):
                    light = scratch[n] if t >= 0 else sky[n]
                    total[n] += 0.25 * seen * min(light, 1.0)
            encode_pixel(total, encode, image[j, i])
