"""Images written byte by byte, as no honest encoder would: bombs, odd kinds, strange parts."""

import functools
import struct
import zlib

import numpy as np

from dfvs_robustness.fuzz.random_source import RandomSource

PNG_MAGIC = b"\x89PNG\r\n\x1a\n"
PNG_HEAD_BYTES = 33
"""Magic and IHDR: other chunks may follow here."""

_ODD_SIZES = (0, 1, 319, 321, 65500, 65535, 1 << 20, (1 << 31) - 1, (1 << 32) - 1)
_CHUNKS = (
    *(b"zTXt", b"iTXt", b"tEXt", b"iCCP", b"eXIf", b"acTL", b"fcTL", b"fdAT", b"tRNS", b"PLTE"),
    *(b"gAMA", b"cHRM", b"sBIT", b"bKGD", b"pHYs", b"tIME", b"IDAT", b"IEND", b"IHDR", b"xxXx"),
)
_MARKERS = (*range(0xC0, 0xD0), *range(0xDA, 0xE3), 0xEE, 0xFE, 0x01, 0xF0)


@functools.cache
def _zeros() -> bytes:
    """64 MiB of zeros in 64 KiB."""
    return zlib.compress(bytes(1 << 26), 9)


def random_bytes(rng: RandomSource, most: int) -> bytes:
    """Up to so many random bytes."""
    return rng.rng.bytes(rng.integer(0, most))


def png_chunk(kind: bytes, data: bytes) -> bytes:
    """One chunk, with its right checksum."""
    return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))


def png(size: tuple[int, int], depth: int, colour: int, data: bytes, interlace: int = 0) -> bytes:
    """PNG of any kind with any data."""
    head = struct.pack(">IIBBBBB", *size, depth, colour, 0, 0, interlace)
    palette = png_chunk(b"PLTE", bytes(range(256)) * 3) if colour == 3 else b""
    parts = (png_chunk(b"IHDR", head), palette, png_chunk(b"IDAT", data), png_chunk(b"IEND", b""))
    return PNG_MAGIC + b"".join(parts)


def odd_png(rng: RandomSource, size: tuple[int, int]) -> bytes:
    """PNG of a random kind: bit depth, colour, interlacing, filters; data too short or too long."""
    depth, colour = rng.pick((1, 2, 4, 8, 16, 8, 16, 3, 0)), rng.pick((0, 2, 3, 4, 6, 6, 1, 7))
    channels = {0: 1, 2: 3, 3: 1, 4: 2, 6: 4}.get(colour, 1)
    line = 1 + (size[0] * channels * depth + 7) // 8
    lines = max(size[1] + rng.pick((0, 0, 0, -1, 1, 100)), 0)
    rows = rng.rng.integers(0, 256, (lines, line), np.uint8)
    rows[:, 0] = rng.rng.integers(0, rng.pick((1, 5, 5, 256)), lines)
    return png(size, depth, colour, zlib.compress(rows.tobytes(), 1), rng.pick((0, 0, 1, 2)))


def png_size_bomb(rng: RandomSource) -> bytes:
    """PNG whose header announces more pixels than memory holds."""
    size = (rng.pick(_ODD_SIZES[3:]), rng.pick(_ODD_SIZES[3:]))
    return png(size, rng.pick((1, 8, 16)), rng.pick((0, 2, 6)), _zeros())


def png_data_bomb(rng: RandomSource, size: tuple[int, int]) -> bytes:
    """PNG of the right size whose data unfold to far more, in its pixels or in a side chunk."""
    if rng.chance(0.5):
        return png(size, 8, 2, _zeros() * rng.integer(1, 3))
    line = bytes(1 + 3 * size[0])
    honest = png(size, 8, 2, zlib.compress(line * size[1], 1))
    kind, head = rng.pick(
        ((b"zTXt", b"key\0\0"), (b"iTXt", b"key\0\1\0\0\0"), (b"iCCP", b"key\0\0"))
    )
    return with_chunk(honest, kind, head + _zeros())


def with_chunk(data: bytes, kind: bytes, content: bytes) -> bytes:
    """Put a chunk right behind a PNG's header."""
    return data[:PNG_HEAD_BYTES] + png_chunk(kind, content) + data[PNG_HEAD_BYTES:]


def with_odd_chunks(rng: RandomSource, data: bytes) -> bytes:
    """Put random chunks into a PNG, now and then thousands."""
    count = rng.pick((1, 2, 5, 5, 10000))
    for _ in range(min(count, 5)):
        data = with_chunk(data, rng.pick(_CHUNKS), random_bytes(rng, 64))
    if count > 5:
        many = png_chunk(rng.pick(_CHUNKS), random_bytes(rng, 8)) * count
        data = data[:PNG_HEAD_BYTES] + many + data[PNG_HEAD_BYTES:]
    return data


def animation(rng: RandomSource, data: bytes, size: tuple[int, int]) -> bytes:
    """PNG with many further frames behind the first."""
    control = struct.pack(">IIIIHHBB", *size, 0, 0, 1, 1, 0, 0)
    extra = b""
    for i in range(rng.pick((1, 100))):
        extra += png_chunk(b"fcTL", struct.pack(">I", 1 + 2 * i) + control)
        extra += png_chunk(b"fdAT", struct.pack(">I", 2 + 2 * i) + _zeros()[:1000])
    head = png_chunk(b"acTL", struct.pack(">II", rng.pick((1, 101, 1 << 31)), 0))
    head += png_chunk(b"fcTL", struct.pack(">I", 0) + control)
    return data[:PNG_HEAD_BYTES] + head + data[PNG_HEAD_BYTES:-12] + extra + data[-12:]


def jpeg_segment(marker: int, content: bytes) -> bytes:
    """One segment of a JPEG, with its right length."""
    return bytes([0xFF, marker]) + struct.pack(">H", len(content) + 2) + content


def with_odd_segments(rng: RandomSource, data: bytes) -> bytes:
    """Put random segments into a JPEG, behind its beginning or anywhere."""
    for _ in range(rng.pick((1, 3, 200))):
        segment = jpeg_segment(rng.pick(_MARKERS), random_bytes(rng, 70))
        at = 2 if rng.chance(0.7) else rng.integer(2, len(data))
        data = data[:at] + segment + data[at:]
    return data


def with_odd_frame_header(rng: RandomSource, data: bytes) -> bytes:
    """Change a JPEG's frame header: its size, precision, sampling or number of components."""
    at = max(data.find(b"\xff\xc0"), data.find(b"\xff\xc2"))
    if at < 0:
        return data
    changed = bytearray(data)
    if rng.chance(0.4):
        height, width = rng.pick(_ODD_SIZES[:6]), rng.pick(_ODD_SIZES[:6])
        changed[at + 5 : at + 9] = struct.pack(">HH", height, width)
    else:
        offset = rng.pick((1, 4, 9, 10, 11, 12, 13, 14, 15, 16, 17, 18))
        changed[at + offset] = rng.pick((0, 1, 2, 4, 12, 16, 0x11, 0x41, 0x44, 0xC1, 0xC9, 255))
    return bytes(changed)


def second_frame_header(rng: RandomSource, data: bytes) -> bytes:
    """JPEG that announces a small size first and a large one after it."""
    content = struct.pack(">BHHB", 8, 65500, 65500, 3) + bytes([1, 0x11, 0, 2, 0x11, 0, 3, 0x11, 0])
    at = data.find(b"\xff\xda") if rng.chance(0.5) else data.find(b"\xff\xc4")
    return data[:at] + jpeg_segment(rng.pick((0xC0, 0xC2)), content) + data[at:]


def long_way(rng: RandomSource, data: bytes) -> bytes:
    """JPEG with up to 8 MB of fill bytes, bare markers or empty segments before its size."""
    filler = rng.pick((b"\xff", b"\xff\x01", b"\xff\xe0\x00\x02"))
    return data[:2] + filler * rng.integer(1, 8_000_000 // len(filler)) + data[2:]


def scan_bomb(rng: RandomSource, size: tuple[int, int]) -> bytes:
    """Progressive JPEG with scan after scan of a dozen bytes, each a walk over all blocks."""
    table = bytes([1] + [0] * 15)
    components = bytes([1, 0x11, 0, 2, 0x11, 0, 3, 0x11, 0])
    blocks = ((size[0] + 7) // 8) * ((size[1] + 7) // 8)
    first = bytes([3, 1, 0, 2, 0, 3, 0, 0, 0, 0])
    scan = jpeg_segment(0xDA, bytes([1, rng.integer(1, 3), 0, 1, 63, 0])) + bytes(4)
    return b"".join(
        (
            b"\xff\xd8",
            jpeg_segment(0xDB, b"\0" + b"\1" * 64),
            jpeg_segment(0xC2, struct.pack(">BHHB", 8, size[1], size[0], 3) + components),
            jpeg_segment(0xC4, b"\x00" + table + b"\x00"),
            jpeg_segment(0xC4, b"\x10" + table + rng.pick((b"\xe0", b"\x00"))),
            jpeg_segment(0xDA, first) + bytes((3 * blocks + 7) // 8),
            scan * rng.pick((1, 30, 62, 63, 64, 1000, 20000)),
            b"\xff\xd9",
        )
    )
