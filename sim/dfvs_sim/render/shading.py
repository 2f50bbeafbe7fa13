"""Colour of the pixels, once it is known which triangle each one sees (numba).

Every attribute f is interpolated as f = (F . p) / (S . p), with F = sum e_i f_i and S = sum e_i
over the edge functions e_i: perspective-correct, and its screen derivatives come for free, which
choose the mip level and the direction of the anisotropic samples.

The small functions are inlined, and arrays go to them one by one rather than in tuples: a call or
a tuple's reference counts would cost more than the work for a pixel.
"""

from typing import TypeAlias

import numpy as np
from numba import njit

from dfvs_core.geometry.arrays import Float32Array, FloatArray, ImageArray
from dfvs_sim.render.geometry import edge_functions
from dfvs_sim.render.texturing import Light, footprint, sample_texture
from dfvs_sim.scene.mesh import Int32Array
from dfvs_sim.scene.texture import Int64Array

Mesh: TypeAlias = tuple[FloatArray, Int32Array, Float32Array, Float32Array]
"""Vertices as (X, Y, W), triangles, uv, vertex colours."""
Surface: TypeAlias = tuple[FloatArray, Int32Array]
"""Attribute planes (V, 6, 3) and texture (V,) of the visible triangles."""
Pack: TypeAlias = tuple[ImageArray, Int64Array, FloatArray]
"""Texels and levels (``TexturePack``), and the sRGB decoding table."""
Colours: TypeAlias = tuple[FloatArray, ImageArray]
"""Sky (3,) in linear light, and the sRGB encoding table over 0 to 1."""

_FAST = {"contract", "arcp", "nsz", "reassoc"}


@njit(cache=True, nogil=True, error_model="numpy", fastmath=_FAST)
def number_visible(ids: Int32Array, numbers: Int32Array, visible: Int32Array) -> int:
    """Number the triangles in ids (H, W) from 0 in the order in which they appear.

    Replaces ids by numbers, writes the triangle of each number to ``visible``, and returns their
    count. numbers : (M,), -1 everywhere at first.
    """
    count = 0
    for j in range(ids.shape[0]):
        for i in range(ids.shape[1]):
            t = ids[j, i]
            if t < 0:
                continue
            if numbers[t] < 0:
                numbers[t] = count
                visible[count] = t
                count += 1
            ids[j, i] = numbers[t]
    return count


@njit(cache=True, nogil=True, error_model="numpy", fastmath=_FAST)
def attribute_planes(mesh: Mesh, visible: Int32Array, planes: FloatArray) -> None:
    """Write S, then F of u, v and the three colours of triangles to planes (V, 6, 3).

    S is scaled so that S . p is 1 / depth, in 1/m.
    """
    clip, triangles, uv, colours = mesh
    e = np.empty((3, 3))
    for n in range(visible.shape[0]):
        t = visible[n]
        det = edge_functions(clip, triangles[t, 0], triangles[t, 1], triangles[t, 2], e)
        for k in range(3):
            for a in range(6):
                planes[n, a, k] = 0.0
            for i in range(3):
                vertex = triangles[t, i]
                weight = e[i, k] / det
                planes[n, 0, k] += weight
                planes[n, 1, k] += weight * uv[vertex, 0]
                planes[n, 2, k] += weight * uv[vertex, 1]
                planes[n, 3, k] += weight * colours[vertex, 0]
                planes[n, 4, k] += weight * colours[vertex, 1]
                planes[n, 5, k] += weight * colours[vertex, 2]


@njit(inline="always")
def shade_point(
    texels: ImageArray,
    decode: FloatArray,
    levels: Int64Array,
    planes: FloatArray,
    place: tuple[int, int, float, float],
) -> Light:
    """Linear light at one point, place = (number of the triangle, its texture, x, y)."""
    n, k, x, y = place
    sx, sy = planes[n, 0, 0], planes[n, 0, 1]
    w = sx * x + sy * y + planes[n, 0, 2]
    if not w > 0.0:
        return 0.0, 0.0, 0.0
    w = 1.0 / w
    red = max((planes[n, 3, 0] * x + planes[n, 3, 1] * y + planes[n, 3, 2]) * w, 0.0)
    green = max((planes[n, 4, 0] * x + planes[n, 4, 1] * y + planes[n, 4, 2]) * w, 0.0)
    blue = max((planes[n, 5, 0] * x + planes[n, 5, 1] * y + planes[n, 5, 2]) * w, 0.0)
    if k < 0:
        return red, green, blue
    ux, uy, vx, vy = planes[n, 1, 0], planes[n, 1, 1], planes[n, 2, 0], planes[n, 2, 1]
    u = (ux * x + uy * y + planes[n, 1, 2]) * w
    v = (vx * x + vy * y + planes[n, 2, 2]) * w
    along_x = ((ux - u * sx) * w, (vx - v * sx) * w)
    along_y = ((uy - u * sy) * w, (vy - v * sy) * w)
    area = footprint((u, v), along_x, along_y, (levels[k, 0, 1], levels[k, 0, 2]))
    r, g, b = sample_texture(texels, decode, levels, k, area)
    return red * r, green * g, blue * b


@njit(inline="always")
def encoded(light: float, encode: ImageArray) -> int:
    """SRGB code of linear light, through a table over 0 to 1; 0 for what is no number."""
    if not light > 0.0:
        return 0
    return int(encode[int(min(light, 1.0) * (encode.shape[0] - 1) + 0.5)])


@njit(cache=True, nogil=True, error_model="numpy", fastmath=_FAST)
def shade(
    surface: Surface, pack: Pack, numbers: Int32Array, colours: Colours, image: ImageArray
) -> None:
    """Colour an image (H, W, 3) from triangle numbers (H, W), one sample at each pixel's centre."""
    planes, texture_index = surface
    texels, levels, decode = pack
    sky, encode = colours
    for j in range(numbers.shape[0]):
        for i in range(numbers.shape[1]):
            n = numbers[j, i]
            red, green, blue = sky[0], sky[1], sky[2]
            if n >= 0:
                place = (n, texture_index[n], i + 0.5, j + 0.5)
                red, green, blue = shade_point(texels, decode, levels, planes, place)
            image[j, i, 0] = encoded(red, encode)
            image[j, i, 1] = encoded(green, encode)
            image[j, i, 2] = encoded(blue, encode)


@njit(inline="always")
def coverage(ids: Int32Array, i: int, j: int, a: int) -> tuple[int, float, float]:
    """How many of pixel (i, j)'s 2 x 2 samples see the triangle of sample a, and their mean place.

    0 if an earlier sample sees it too. ids : (2H, 2W).
    """
    seen, x, y = 0, 0.0, 0.0
    t = ids[2 * j + a // 2, 2 * i + a % 2]
    for b in range(4):
        if ids[2 * j + b // 2, 2 * i + b % 2] == t:
            if b < a:
                return 0, 0.0, 0.0
            seen += 1
            x += 0.25 + 0.5 * (b % 2)
            y += 0.25 + 0.5 * (b // 2)
    return seen, i + x / seen, j + y / seen


@njit(cache=True, nogil=True, error_model="numpy", fastmath=_FAST)
def shade_antialiased(
    surface: Surface, pack: Pack, numbers: Int32Array, colours: Colours, image: ImageArray
) -> None:
    """Colour an image (H, W, 3) from triangle numbers (2H, 2W): 2 x 2 coverage samples a pixel.

    A triangle seen by several of the four samples is shaded once, at their mean position, with a
    footprint of one whole pixel; light is averaged, not its sRGB code.
    """
    planes, texture_index = surface
    texels, levels, decode = pack
    sky, encode = colours
    for j in range(image.shape[0]):
        for i in range(image.shape[1]):
            red, green, blue = 0.0, 0.0, 0.0
            for a in range(4):
                seen, x, y = coverage(numbers, i, j, a)
                if seen == 0:
                    continue
                n = numbers[2 * j + a // 2, 2 * i + a % 2]
                r, g, b = sky[0], sky[1], sky[2]
                if n >= 0:
                    place = (n, texture_index[n], x, y)
                    r, g, b = shade_point(texels, decode, levels, planes, place)
                red += 0.25 * seen * min(r, 1.0)
                green += 0.25 * seen * min(g, 1.0)
                blue += 0.25 * seen * min(b, 1.0)
            image[j, i, 0] = encoded(red, encode)
            image[j, i, 1] = encoded(green, encode)
            image[j, i, 2] = encoded(blue, encode)
