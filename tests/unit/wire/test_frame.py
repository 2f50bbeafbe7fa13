import struct
import time
import zlib

import cv2
import numpy as np
import pytest

from dfvs_core.errors import DfvsError, ImageError, WireError
from dfvs_core.messages.frame import (
    Frame,
    PixelFormat,
    clock_identity,
    decode_frame,
    decode_header,
    encode_frame,
)
from dfvs_core.messages.image import decode_image, encode_jpeg, encode_png, image_size


@pytest.fixture
def frame(rng):
    smooth = rng.integers(0, 255, (6, 8, 3)).astype(np.uint8)
    return Frame(np.kron(smooth, np.ones((8, 8, 1), np.uint8)), 123_456_789, 42)


@pytest.mark.parametrize("pixel_format", [PixelFormat.RGB8, PixelFormat.BGR8, PixelFormat.PNG])
def test_lossless_formats_give_back_every_bit(frame, pixel_format):
    payload, attachment = encode_frame(frame, pixel_format)
    again = decode_frame(payload, decode_header(attachment))
    np.testing.assert_array_equal(again.image, frame.image)
    assert (again.t_capture_ns, again.seq) == (frame.t_capture_ns, frame.seq)


def test_jpeg_gives_back_the_colours_nearly(frame):
    payload, attachment = encode_frame(frame, PixelFormat.JPEG, quality=95)
    again = decode_frame(payload, decode_header(attachment))
    assert np.abs(again.image.astype(int) - frame.image).mean() < 8


@pytest.mark.parametrize("pixel_format", list(PixelFormat))
def test_a_side_that_the_header_cannot_hold_is_refused(pixel_format):
    wide = Frame(np.zeros((2, 70_000, 3), np.uint8), 1, 1)
    with pytest.raises(ImageError, match="70000 x 2 px; expected at most 65535 px a side"):
        encode_frame(wide, pixel_format)


def test_mono_comes_back_grey(frame):
    payload, attachment = encode_frame(frame, PixelFormat.MONO8)
    image = decode_frame(payload, decode_header(attachment)).image
    assert image.shape == frame.image.shape
    assert (image[..., 0] == image[..., 2]).all()


@pytest.mark.parametrize("pixel_format", list(PixelFormat))
def test_one_flipped_bit_is_noticed(frame, pixel_format):
    payload, attachment = encode_frame(frame, pixel_format)
    broken = bytearray(payload)
    broken[len(broken) // 2] ^= 0x10
    with pytest.raises(WireError, match="checksum"):
        decode_frame(bytes(broken), decode_header(attachment))


@pytest.mark.parametrize("pixel_format", list(PixelFormat))
def test_a_truncated_payload_is_refused(frame, pixel_format):
    payload, attachment = encode_frame(frame, pixel_format)
    with pytest.raises(WireError):
        decode_frame(payload[:-7], decode_header(attachment))


@pytest.mark.parametrize("attachment", [b"", b"x" * 47, b"y" * 48, b"z" * 500])
def test_foreign_attachments_are_refused(attachment):
    with pytest.raises(WireError):
        decode_header(attachment)


def test_an_unknown_pixel_format_is_refused(frame):
    _, attachment = encode_frame(frame, PixelFormat.RGB8)
    with pytest.raises(WireError, match="pixel format 9"):
        decode_header(attachment[:5] + b"\x09" + attachment[6:])


def test_a_picture_larger_than_announced_is_not_decoded(frame):
    """The header says 16 x 16; the PNG inside says more: no byte of it is unfolded."""
    payload = encode_png(frame.image)
    _, small = encode_frame(Frame(frame.image[:16, :16], 1, 1), PixelFormat.PNG)
    header = small[:12] + struct.pack("<I", zlib.crc32(payload)) + small[16:]
    with pytest.raises(ImageError, match="64 x 48"):
        decode_frame(payload, decode_header(header))


def test_an_image_bomb_is_refused_by_its_header():
    """A PNG header that announces 60000 x 60000 px, with next to nothing behind it."""
    chunk = b"IHDR" + struct.pack(">IIBBBBB", 60000, 60000, 8, 2, 0, 0, 0)
    bomb = b"\x89PNG\r\n\x1a\n" + struct.pack(">I", 13) + chunk + struct.pack(">I", 0) + b"\0" * 99
    with pytest.raises(ImageError, match="60000 x 60000"):
        decode_image(bomb)


def png_chunk(kind, data):
    return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))


def test_a_png_that_unfolds_to_more_than_its_pixels_is_refused(frame):
    """Four megabytes of zeros behind a header of 64 x 48 px."""
    head = encode_png(frame.image)[:33]
    bomb = head + png_chunk(b"IDAT", zlib.compress(bytes(1 << 22), 9)) + png_chunk(b"IEND", b"")
    with pytest.raises(ImageError, match="unfolds to more"):
        decode_image(bomb)


def test_texts_and_profiles_of_a_png_are_not_unfolded(frame):
    """Each of these 200 chunks would unfold to 8 MB in the decoder."""
    whole = encode_png(frame.image)
    text = png_chunk(b"zTXt", b"key\0\0" + zlib.compress(bytes(1 << 23), 9))
    began_s = time.thread_time()
    np.testing.assert_array_equal(decode_image(whole[:33] + text * 200 + whole[33:]), frame.image)
    assert time.thread_time() - began_s < 0.2  # 3 s if they were


def test_a_png_without_its_end_is_refused(frame):
    whole = encode_png(frame.image)
    for cut in (12, 13, len(whole) // 2):
        with pytest.raises(ImageError, match="cut short"):
            decode_image(whole[:-cut])


def test_a_png_of_very_many_chunks_is_refused(frame):
    whole = encode_png(frame.image)
    with pytest.raises(ImageError, match="too many chunks"):
        decode_image(whole[:33] + png_chunk(b"tEXt", b"k\0v") * 9000 + whole[33:])


@pytest.mark.parametrize("flags", [[], [cv2.IMWRITE_PNG_COMPRESSION, 0]])
@pytest.mark.parametrize("dtype", [np.uint8, np.uint16])
@pytest.mark.parametrize("channels", [1, 3, 4])
def test_every_kind_of_png_is_read(rng, channels, dtype, flags):
    pixels = rng.integers(0, np.iinfo(dtype).max, (48, 64, channels)).astype(dtype)
    ok, data = cv2.imencode(".png", pixels, flags)
    assert ok
    assert decode_image(bytes(data)).shape == (48, 64, 3)


def png_of_16_bits(rng, most):
    """Pixels (48, 64, 3) uint16, BGR, and their PNG; ``most`` is the largest of their values."""
    pixels = rng.integers(0, most, (48, 64, 3)).astype(np.uint16)
    pixels[7, 5, 1] = most
    ok, data = cv2.imencode(".png", pixels)
    assert ok
    return pixels, bytes(data)


@pytest.mark.parametrize("most", [4096, 65535])
def test_the_high_byte_of_16_bits_is_kept(rng, most):
    pixels, data = png_of_16_bits(rng, most)
    np.testing.assert_array_equal(decode_image(data), pixels[:, :, ::-1] >> 8)


def test_12_bits_in_a_png_of_16_are_refused_with_what_to_do(rng):
    _, data = png_of_16_bits(rng, 4095)
    with pytest.raises(ImageError, match=r"largest value is 4095; .*multiply.*12 bits by 16"):
        decode_image(data)


def test_a_jpeg_of_very_many_scans_is_refused(frame):
    """Each scan costs a dozen bytes and a walk over the whole picture."""
    ok, data = cv2.imencode(".jpg", frame.image, [cv2.IMWRITE_JPEG_PROGRESSIVE, 1])
    assert ok
    progressive = bytes(data)
    assert decode_image(progressive).shape == frame.image.shape
    scan = b"\xff\xda\x00\x08\x01\x01\x00\x01\x3f\x00" + bytes(4)
    with pytest.raises(ImageError, match="scans"):
        decode_image(progressive[:-2] + scan * 100 + progressive[-2:])


@pytest.mark.parametrize("marker", [0xC3, 0xC5, 0xC9, 0xCA, 0xCF])
def test_odd_kinds_of_jpeg_are_refused(frame, marker):
    data = encode_jpeg(frame.image).replace(b"\xff\xc0", bytes([0xFF, marker]), 1)
    with pytest.raises(ImageError, match=f"kind 0x{marker:02X}"):
        image_size(data)


@pytest.mark.parametrize(
    ("filler", "reason"),
    [
        (b"\xff" * 8_000_000, "cut short"),
        (b"\xff\x01" * 4_000_000, "too many segments"),
        (b"\xff\xe0\x00\x02" * 2_000_000, "too many segments"),
    ],
    ids=["fill bytes", "bare markers", "empty segments"],
)
def test_megabytes_before_a_jpegs_size_are_not_walked_through(filler, reason):
    with pytest.raises(ImageError, match=reason):
        image_size(b"\xff\xd8\xff\xe0\x00\x02" + filler)


def test_fill_bytes_before_a_marker_are_passed_over(frame):
    data = encode_jpeg(frame.image)
    at = data.index(b"\xff\xc0")
    assert image_size(data[:at] + b"\xff" * 5 + data[at:]) == (64, 48)


def test_pixels_stay_where_the_sensor_had_them(frame):
    """An Exif note that the picture be turned by 180 degrees changes nothing."""
    tag = struct.pack("<HHIHH", 0x112, 3, 1, 3, 0)
    tiff = b"II*\0" + struct.pack("<IH", 8, 1) + tag + struct.pack("<I", 0)
    note = b"Exif\0\0" + tiff
    plain = encode_jpeg(frame.image)
    turned = plain[:2] + b"\xff\xe1" + struct.pack(">H", len(note) + 2) + note + plain[2:]
    np.testing.assert_array_equal(decode_image(turned), decode_image(plain))


def test_sizes_are_read_from_headers(frame):
    assert image_size(encode_png(frame.image)) == (64, 48)
    assert image_size(encode_jpeg(frame.image)) == (64, 48)


@pytest.mark.parametrize("data", [b"", b"GIF89a....", b"\xff\xd8\xff", b"\x89PNG\r\n\x1a\nshort"])
def test_what_is_no_picture_is_refused(data):
    with pytest.raises(ImageError):
        decode_image(data)


def test_random_bytes_never_do_worse_than_an_error(frame, rng):
    good = encode_jpeg(frame.image)
    for _ in range(300):
        data = bytearray(good)
        for at in rng.integers(0, len(data), 6):
            data[at] = int(rng.integers(256))
        try:
            image = decode_image(bytes(data), max_pixels=64 * 48)
        except DfvsError:
            continue
        assert image.size <= 64 * 48 * 3


def test_clocks_are_told_apart():
    one = clock_identity("8b2f5b1e-7b5d-4a3e-9c39-7d9f3c1a2b4c\n")
    assert len(one) == 16
    with pytest.raises(WireError):
        clock_identity("not a uuid")


@pytest.mark.parametrize("encode", [encode_jpeg, encode_png])
def test_an_image_of_no_pixels_cannot_be_encoded(encode):
    with pytest.raises(ImageError, match="cannot be encoded"):
        encode(np.zeros((0, 0, 3), np.uint8))
