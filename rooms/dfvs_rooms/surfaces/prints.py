"""Things with writing or drawing on them: boards, posters, labels; and the sky.

Every function returns (H, W, 3) float32 sRGB in 0 to 1; they are stretched over what shows them.
"""

import cv2
import numpy as np

from dfvs_core.geometry.arrays import Float32Array, ImageArray
from dfvs_rooms.surfaces import artwork, textures
from dfvs_rooms.surfaces.textures import (
    SIZE_PX,
    Colour,
    blend,
    coordinates,
    floats,
    noise,
    ramp,
    smoothstep,
)

_PAPERS: tuple[Colour, ...] = (
    (0.95, 0.94, 0.90), (0.96, 0.90, 0.55), (0.70, 0.84, 0.92), (0.93, 0.72, 0.70),
    (0.78, 0.90, 0.72),
)  # fmt: skip
_INKS: tuple[Colour, ...] = (
    (0.12, 0.13, 0.16),
    (0.13, 0.25, 0.55),
    (0.65, 0.14, 0.12),
    (0.10, 0.42, 0.25),
)
_HEADINGS = ("NOTICE", "RULES", "MENU", "PLAN", "ROTA", "EXIT", "TODAY", "CLUB", "SALE", "HELP")


def _bytes(colour: Colour) -> tuple[int, int, int]:
    """Colour of 0 to 1 as 0 to 255, as OpenCV draws it."""
    r, g, b = (round(255 * min(max(c, 0.0), 1.0)) for c in colour)
    return r, g, b


def _written(
    image: ImageArray, box: tuple[int, int, int, int], ink: Colour, rng: np.random.Generator
) -> None:
    """Fill a box (left, top, right, bottom), px, of an image with a heading and lines, in place.

    Lines are broken into words of drawn lengths.
    """
    left, top, right, bottom = box
    colour = _bytes(ink)
    scale = max(0.25, (right - left) / 170)
    word = _HEADINGS[int(rng.integers(len(_HEADINGS)))]
    at = (left + 4, top + int(22 * scale) + 3)
    font = cv2.FONT_HERSHEY_SIMPLEX
    cv2.putText(image, word, at, font, scale, colour, max(1, round(2 * scale)), cv2.LINE_AA)
    for y in range(at[1] + 8, bottom - 4, 6):
        x = left + 5
        while x < right - 12:
            end = min(x + int(rng.integers(5, 22)), right - 5)
            if rng.random() < 0.93:
                cv2.line(
                    image, (x, y), (end, y), colour, 2 if rng.random() < 0.3 else 1, cv2.LINE_AA
                )
            x = end + 4


def noticeboard(rng: np.random.Generator) -> Float32Array:
    """Cork with sheets of paper pinned to it, some of them pictures."""
    height, width = SIZE_PX, 3 * SIZE_PX // 2
    cork = 1 + 0.14 * noise(rng, (height, width), slope=0.4, band=(20.0, 300.0))
    image = textures.pixels(textures.shaded((0.66, 0.47, 0.29), cork))
    for _ in range(22):
        w, h = int(rng.integers(70, 190)), int(rng.integers(80, 200))
        x, y = int(rng.integers(6, width - w - 6)), int(rng.integers(6, height - h - 6))
        image[y + 4 : y + h + 4, x + 4 : x + w + 4] //= 2
        if rng.random() < 0.25:
            painters = (artwork.landscape, artwork.contours, artwork.city)
            painting = painters[int(rng.integers(3))](rng)
            image[y : y + h, x : x + w] = cv2.resize(textures.pixels(painting), (w, h))
        else:
            image[y : y + h, x : x + w] = _bytes(_PAPERS[int(rng.integers(len(_PAPERS)))])
            _written(image, (x, y, x + w, y + h), _INKS[int(rng.integers(len(_INKS)))], rng)
        cv2.circle(
            image, (x + w // 2, y + 6), 5, _bytes(_INKS[int(rng.integers(1, 4))]), -1, cv2.LINE_AA
        )
    return floats(image)


def whiteboard(rng: np.random.Generator) -> Float32Array:
    """Wiped board with boxes, arrows, curves and lines of writing."""
    height, width = SIZE_PX, 3 * SIZE_PX // 2
    smear = 1 + 0.012 * noise(rng, (height, width), slope=1.2, band=(2.0, 60.0), stretch=(3.0, 1.0))
    image = textures.pixels(textures.shaded((0.93, 0.94, 0.95), smear))
    for _ in range(7):
        x, y = int(rng.integers(20, width - 200)), int(rng.integers(20, height - 130))
        w, h = int(rng.integers(90, 180)), int(rng.integers(60, 120))
        ink = _INKS[int(rng.integers(len(_INKS)))]
        cv2.rectangle(image, (x, y), (x + w, y + h), _bytes(ink), 3, cv2.LINE_AA)
        _written(image, (x, y, x + w, y + h), ink, rng)
        end = (int(rng.integers(20, width - 20)), int(rng.integers(20, height - 20)))
        cv2.arrowedLine(
            image, (x + w, y + h // 2), end, _bytes(ink), 2, cv2.LINE_AA, tipLength=0.06
        )
    t = np.linspace(0, 1, 60)
    for ink in _INKS[:3]:
        curve = 70 * np.sin(2 * np.pi * (rng.uniform(0.5, 2.5) * t + rng.random())) * (1 - t)
        points = np.stack([40 + 300 * t, height - 120 + curve], 1).astype(np.int32)
        cv2.polylines(image, [points], False, _bytes(ink), 3, cv2.LINE_AA)
    return floats(image)


def menu_board(rng: np.random.Generator) -> Float32Array:
    """Chalk on a blackboard."""
    height, width = SIZE_PX, 3 * SIZE_PX // 2
    dust = 1 + 0.10 * noise(rng, (height, width), slope=1.3, band=(2.0, 80.0))
    image = textures.pixels(textures.shaded((0.14, 0.17, 0.16), dust))
    for k in range(3):
        left = 20 + k * (width - 20) // 3
        _written(image, (left, 15, left + width // 3 - 40, height - 20), (0.88, 0.87, 0.82), rng)
    return floats(image)


def poster(rng: np.random.Generator) -> Float32Array:
    """Printed sheet: a picture above, a heading and lines below."""
    painters = (artwork.city, artwork.landscape, artwork.swirls, artwork.contours)
    painting = painters[int(rng.integers(len(painters)))](rng)
    paper = _bytes(_PAPERS[int(rng.integers(len(_PAPERS)))])
    image: ImageArray = np.full((384, 272, 3), paper, np.uint8)
    image[14:240, 14:258] = cv2.resize(textures.pixels(painting), (244, 226))
    _written(image, (14, 245, 258, 372), _INKS[int(rng.integers(len(_INKS)))], rng)
    return floats(image)


def label(rng: np.random.Generator, colour: Colour) -> Float32Array:
    """Wrapper of a tin or a jar, to go round it: a band with a heading twice."""
    image: ImageArray = np.full((128, 512, 3), _bytes(colour), np.uint8)
    image[:10] = image[-10:] = _bytes((0.72, 0.72, 0.70))
    paper = _bytes(_PAPERS[int(rng.integers(len(_PAPERS)))])
    for left in (30, 286):
        image[24:106, left : left + 190] = paper
        _written(image, (left, 22, left + 186, 104), _INKS[int(rng.integers(len(_INKS)))], rng)
    return textures.shaded(floats(image), 1 + 0.03 * noise(rng, (128, 512), slope=0.8))


def files(rng: np.random.Generator) -> Float32Array:
    """Backs of 24 box files side by side, with labels and finger holes."""
    height, width = SIZE_PX // 2, 2 * SIZE_PX
    image: ImageArray = np.full((height, width, 3), 40, np.uint8)
    tones = ((0.13, 0.14, 0.16), (0.16, 0.28, 0.48), (0.60, 0.14, 0.13), (0.78, 0.77, 0.74))
    for left in np.linspace(0, width, 25)[:-1].astype(int):
        tone = _bytes(tones[int(rng.integers(len(tones)))])
        image[:, left + 1 : left + 41] = tone
        image[30:150, left + 7 : left + 36] = _bytes((0.93, 0.92, 0.88))
        for y in range(38, 145, 9):
            end = left + int(rng.integers(16, 34))
            cv2.line(image, (left + 10, y), (end, y), (40, 42, 60), 2, cv2.LINE_AA)
        cv2.circle(image, (left + 21, 205), 11, (185, 185, 188), 3, cv2.LINE_AA)
    return textures.shaded(floats(image), 1 + 0.03 * noise(rng, (height, width), slope=0.8))


def drawing(rng: np.random.Generator) -> Float32Array:
    """Workshop drawing: white lines on blue, with dimensions and a table of parts."""
    height, width = 384, SIZE_PX
    image: ImageArray = np.full((height, width, 3), _bytes((0.16, 0.30, 0.52)), np.uint8)
    white, grid = (0.86, 0.90, 0.95), _bytes((0.22, 0.36, 0.58))
    line = _bytes(white)
    for step in range(0, width, 32):
        cv2.line(image, (step, 0), (step, height), grid, 1)
        cv2.line(image, (0, step), (width, step), grid, 1)
    for _ in range(9):
        x, y = int(rng.integers(20, 330)), int(rng.integers(20, 260))
        w, h = int(rng.integers(30, 150)), int(rng.integers(20, 100))
        cv2.rectangle(image, (x, y), (x + w, y + h), line, 2, cv2.LINE_AA)
        cv2.circle(image, (x + w // 2, y + h // 2), max(4, h // 3), line, 1, cv2.LINE_AA)
        cv2.line(image, (x, y + h + 10), (x + w, y + h + 10), line, 1, cv2.LINE_AA)
    _written(image, (360, 270, 500, 376), white, rng)
    return floats(image)


def sky(rng: np.random.Generator) -> Float32Array:
    """Sky with clouds, all around (x) and from the zenith to the horizon (y)."""
    shape = (SIZE_PX, 2 * SIZE_PX)
    _, y = coordinates(shape)
    image = ramp(
        y, [(0.24, 0.44, 0.78), (0.40, 0.60, 0.88), (0.66, 0.79, 0.94), (0.88, 0.92, 0.95)]
    )
    field = noise(rng, shape, slope=1.35, band=(2.0, 180.0), stretch=(1.6, 1.0))
    cover = smoothstep(0.1, 1.7, field) * smoothstep(0.02, 0.2, y)
    belly = smoothstep(-0.5, 1.5, noise(rng, shape, slope=1.5, band=(3.0, 60.0)))
    white = ramp(belly, [(0.99, 0.99, 1.0), (0.84, 0.86, 0.90)])
    return blend(image, white, 0.95 * cover)
