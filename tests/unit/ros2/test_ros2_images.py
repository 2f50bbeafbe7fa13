"""Images of every encoding become the picture that was sent, or are refused."""

import cv2
import numpy as np
import pytest
from ros2_samples import STAMP_NS, compressed_message, image_message, info_message

from dfvs_common.ros2 import type_hash
from dfvs_core.errors import DfvsError, GeometryError, WireError
from dfvs_core.geometry.camera import CameraModel
from dfvs_core.messages.frame import decode_frame, decode_header
from dfvs_core.messages.image import encode_jpeg, encode_png
from dfvs_core.messages.ros2 import Ros2Attachment
from dfvs_service.frames import RawSample
from dfvs_service.ros2.frame_source import ClockReading, Ros2FrameSource
from dfvs_service.settings.camera_section import Ros2CameraSection

MS = 1_000_000
CLOCK = b"c" * 16
NOW = ClockReading(STAMP_NS + 30 * MS, 5_000 * MS)
WIDTH, HEIGHT = 20, 18


class Rig:
    """An intake with its clocks in hand."""

    def __init__(self, *, compressed=False, link="rmw", topic="drone1/camera/image_raw"):
        self.now = NOW
        section = Ros2CameraSection(topic=topic, compressed=compressed)
        self.intake = Ros2FrameSource(link, section, CLOCK, lambda: self.now)

    def frame(self, payload, attachment=b"", publisher=""):
        raw = RawSample(payload, attachment, NOW.monotonic_ns, publisher)
        sample = self.intake.translate(raw)
        header = decode_header(sample.attachment)
        assert header.clock == CLOCK
        if (header.width, header.height) != (WIDTH, HEIGHT):
            raise WireError("perception looks no further at a frame of another size")
        assert sample.t_arrival_ns == NOW.monotonic_ns
        return decode_frame(sample.payload, header)


@pytest.fixture
def picture(rng):
    """(H, W, 3) RGB."""
    return rng.integers(0, 256, (HEIGHT, WIDTH, 3)).astype(np.uint8)


def with_alpha(rgb):
    return np.concatenate([rgb, np.full((HEIGHT, WIDTH, 1), 7, np.uint8)], axis=2)


def grey(rgb):
    return rgb[:, :, :1]


@pytest.mark.parametrize(
    ("encoding", "pack", "is_grey"),
    [
        ("rgb8", lambda rgb: rgb, False),
        ("bgr8", lambda rgb: rgb[:, :, ::-1], False),
        ("8UC3", lambda rgb: rgb[:, :, ::-1], False),
        ("rgba8", with_alpha, False),
        ("bgra8", lambda rgb: with_alpha(rgb[:, :, ::-1]), False),
        ("mono8", grey, True),
        ("8UC1", grey, True),
    ],
)
@pytest.mark.parametrize("padding", [0, 11])
def test_every_encoding_gives_the_picture_back_also_with_padded_rows(
    picture, encoding, pack, is_grey, padding
):
    pixels = np.ascontiguousarray(pack(picture))
    step = WIDTH * pixels.shape[2] + padding
    frame = Rig().frame(image_message(pixels, encoding, step=step))
    expected = np.repeat(grey(picture), 3, axis=2) if is_grey else picture
    np.testing.assert_array_equal(frame.image, expected)


@pytest.mark.parametrize("is_bigendian", [0, 1])
def test_sixteen_bits_are_read_in_the_byte_order_that_the_message_names(picture, is_bigendian):
    low = np.full((HEIGHT, WIDTH, 1), 0x5A, np.uint8)
    pair = [grey(picture), low] if is_bigendian else [low, grey(picture)]
    pixels = np.concatenate(pair, axis=2)
    frame = Rig().frame(image_message(pixels, "mono16", is_bigendian=is_bigendian))
    np.testing.assert_array_equal(frame.image[:, :, :1], grey(picture))


@pytest.mark.parametrize(("encoding", "luma_at"), [("yuv422", 1), ("yuv422_yuy2", 0)])
def test_yuv_without_colour_is_grey_of_its_luma(encoding, luma_at):
    luma = np.linspace(30, 220, HEIGHT * WIDTH).astype(np.uint8).reshape(HEIGHT, WIDTH)
    pixels = np.full((HEIGHT, WIDTH, 2), 128, np.uint8)
    pixels[:, :, luma_at] = luma
    frame = Rig().frame(image_message(pixels, encoding))
    # Video range: 16..235 becomes 0..255.
    expected = np.clip((luma.astype(float) - 16) * 255 / 219, 0, 255)
    assert np.abs(frame.image - expected[:, :, None]).max() <= 2


@pytest.mark.parametrize("order", ["rggb", "bggr", "gbrg", "grbg"])
def test_bayer_patterns_keep_red_red_and_blue_blue(order):
    colour = {"r": 200, "g": 120, "b": 40}
    tile = np.array([colour[c] for c in order], np.uint8).reshape(2, 2)
    pixels = np.tile(tile, (HEIGHT // 2, WIDTH // 2))[:, :, None]
    frame = Rig().frame(image_message(pixels, f"bayer_{order}8"))
    np.testing.assert_array_equal(
        frame.image[2:-2, 2:-2], np.broadcast_to([200, 120, 40], (14, 16, 3))
    )


@pytest.mark.parametrize(
    ("data", "kind", "exact"),
    [
        (lambda rgb: encode_png(rgb), "bgr8; png compressed bgr8", True),
        (lambda rgb: encode_jpeg(rgb, 95), "rgb8; jpeg compressed bgr8", False),
    ],
)
def test_compressed_images_arrive_untouched(data, kind, exact):
    ramp = np.tile(np.arange(0, 200, 10, dtype=np.uint8)[None, :, None], (HEIGHT, 1, 3))
    frame = Rig(compressed=True).frame(compressed_message(data(ramp), kind))
    assert np.abs(frame.image.astype(int) - ramp).max() <= (0 if exact else 6)


def test_the_stamp_becomes_the_monotonic_time_of_capture(picture):
    frame = Rig().frame(image_message(picture, "rgb8"))
    assert frame.t_capture_ns == NOW.monotonic_ns - 30 * MS


def test_a_system_clock_that_is_set_costs_one_frame_and_no_wrong_age(picture):
    rig = Rig()
    rig.frame(image_message(picture, "rgb8"))
    # Set back by 200 ms: the frame on its way would seem 170 ms in the future, or fresh when old.
    rig.now = ClockReading(NOW.wall_ns - 150 * MS, NOW.monotonic_ns + 50 * MS)
    with pytest.raises(WireError, match="system clock was set by -200 ms"):
        rig.frame(image_message(picture, "rgb8"))
    rig.now = ClockReading(rig.now.wall_ns + 50 * MS, rig.now.monotonic_ns + 50 * MS)
    stamp_ns = rig.now.wall_ns - 20 * MS
    frame = rig.frame(image_message(picture, "rgb8", stamp_ns=stamp_ns))
    assert frame.t_capture_ns == rig.now.monotonic_ns - 20 * MS


def test_images_of_two_cameras_in_turn_are_refused_and_another_one_costs_one_frame(picture):
    rig = Rig(link="bridge")
    left, right = (image_message(picture, "rgb8", frame_id=name) for name in ("left", "right"))
    rig.frame(left)
    for payload in (right, left, right):
        with pytest.raises(WireError, match=r"frame_id is .*; expected one camera on the topic"):
            rig.frame(payload)
    rig.frame(right)


@pytest.mark.parametrize("link", ["rmw", "bridge"])
def test_two_cameras_of_one_frame_id_are_told_by_their_publishers(picture, link):
    rig, payload = Rig(link=link), image_message(picture, "rgb8", frame_id="camera")

    def frame(camera):
        if link == "bridge":
            return rig.frame(payload, publisher=f"bridge-{camera}")
        return rig.frame(payload, Ros2Attachment(5, STAMP_NS, bytes([camera]) * 16).encode())

    frame(1)
    for camera in (2, 1, 2):
        with pytest.raises(WireError, match=r"publisher is .*; expected one camera on the topic"):
            frame(camera)
    frame(2)


def test_the_sequence_is_the_publisher_s_where_it_sends_one(picture):
    rig = Rig()
    payload = image_message(picture, "rgb8")
    assert rig.frame(payload, b"some other version's").seq == 1
    assert rig.frame(payload, Ros2Attachment(41, STAMP_NS, bytes(16)).encode()).seq == 41


@pytest.mark.parametrize(
    ("payload", "words"),
    [
        (lambda p: b"", "are no ROS 2 Image"),
        (lambda p: image_message(p, "rgb8")[:-1], "are no ROS 2 Image"),
        (lambda p: image_message(p, "rgb8") + b"12345", "are no ROS 2 Image"),
        (lambda p: b"\x07\x01" + image_message(p, "rgb8")[2:], "are no ROS 2 Image"),
        (lambda p: image_message(p, "32FC1"), "encoding '32FC1'"),
        (lambda p: image_message(p[:, :, :2], "rgb8"), "18 rows of 60 bytes"),
        (lambda p: image_message(p[:, :19, :2], "yuv422"), "an even width"),
        (lambda p: image_message(p, "rgb8", stamp_ns=0), "header.stamp"),
        (lambda p: image_message(p, "rgb8", stamp_ns=5 * 10**9), "s ago by its stamp"),
        (lambda p: image_message(p[:, :0], "rgb8", step=3), "0 x 18 px"),
    ],
)
def test_what_is_wrong_with_a_message_is_said(picture, payload, words):
    with pytest.raises(WireError, match=words):
        Rig().frame(payload(picture))


@pytest.mark.parametrize("data", [b"", b"\x00" * 40, b"\xff\xd8\xff\xe0"])
def test_a_compressed_image_that_is_none_is_refused(data):
    with pytest.raises(DfvsError):
        Rig(compressed=True).frame(compressed_message(data, "16UC1; compressedDepth png"))


@pytest.mark.parametrize(("compressed", "count"), [(False, 3000), (True, 300)])
def test_damaged_bytes_never_get_past_as_anything_but_a_dfvs_error(picture, rng, compressed, count):
    rig = Rig(compressed=compressed)
    good = compressed_message(encode_png(picture)) if compressed else image_message(picture, "rgb8")
    refused = 0
    for _ in range(count):
        data = bytearray(good)
        for at in rng.integers(0, 90, rng.integers(1, 6)):
            data[at] = rng.integers(256)
        try:
            rig.frame(bytes(data[: len(data) - int(rng.integers(0, 3))]))
        except DfvsError:
            refused += 1
    assert refused > count / 2


def test_keys_of_image_and_calibration():
    assert Rig().intake.key == "0/drone1/camera/image_raw/sensor_msgs::msg::dds_::Image_/*"
    bridge = Rig(link="bridge").intake
    assert bridge.key == "drone1/camera/image_raw"
    assert bridge.calibration_key == "drone1/camera/camera_info"


def test_type_hashes_are_those_that_ros_2_publishes():
    # As ROS 2 prints it: ros2 topic info -v (sensor_msgs of Jazzy).
    assert type_hash("sensor_msgs/msg/Image") == (
        "RIHS01_d31d41a9a4c4bc8eae9be757b0beed306564f7526c88ea6a4588fb9582527d47"
    )
    assert type_hash("std_msgs/msg/String") == (
        "RIHS01_df668c740482bbd48fb39d76a70dfd4bd59db1288021743503259e948f6b1a18"
    )


K = [500.0, 0.0, 319.5, 0.0, 510.0, 239.5, 0.0, 0.0, 1.0]


def test_camera_info_becomes_a_camera_with_our_pixel_centres():
    camera = Rig().intake.camera(info_message((640, 480), K, (0.1, -0.2, 0.01, 0.02, 0.3)))
    assert camera == CameraModel(640, 480, 500.0, 510.0, 320.0, 240.0, (0.1, -0.2, 0.01, 0.02, 0.3))
    # The same point of the world must fall on the same place of the picture in both conventions.
    point = np.array([[0.3, -0.2, 2.0]])
    ros, _ = cv2.projectPoints(
        point, np.zeros(3), np.zeros(3), np.array(K).reshape(3, 3), np.array(camera.distortion)
    )
    np.testing.assert_allclose(camera.project(point), ros.reshape(1, 2) + 0.5, atol=1e-9)


def test_a_camera_info_that_is_not_calibrated_is_none():
    assert Rig().intake.camera(info_message((640, 480), [0.0] * 9)) is None


@pytest.mark.parametrize("name", ["image_rect", "image_rect_color", "image_rect/compressed"])
def test_a_rectified_image_is_that_of_the_projection_matrix_without_distortion(name):
    P = [400.0, 0.0, 299.5, 0.0, 0.0, 410.0, 229.5, 0.0, 0.0, 0.0, 1.0, 0.0]
    info = info_message((640, 480), K, (0.1, -0.2, 0.01, 0.02), "equidistant", P)
    intake = Rig(link="bridge", topic=f"drone1/camera/{name}").intake
    assert intake.calibration_key == "drone1/camera/camera_info"
    assert intake.camera(info) == CameraModel(640, 480, 400.0, 410.0, 300.0, 230.0)
    assert intake.camera(info_message((640, 480), [0.0] * 9)) is None
    with pytest.raises(WireError, match="without a projection matrix"):
        intake.camera(info_message((640, 480), K))


@pytest.mark.parametrize(
    ("info", "error"),
    [
        (lambda: info_message((640, 480), K, (1, 2, 3, 4), "equidistant"), WireError),
        (lambda: info_message((640, 480), K, (1, 2, 3), "plumb_bob"), WireError),
        (lambda: info_message((640, 480), K, binning_x=2), WireError),
        (lambda: info_message((640, 480), [np.nan] * 9), GeometryError),
        (lambda: info_message((0, 0), K), GeometryError),
        (lambda: info_message((640, 480), K, (-1.5, 0.0, 0.0, 0.0)), GeometryError),
        (lambda: b"\x00\x01\x00\x00", WireError),
    ],
)
def test_a_camera_that_our_model_cannot_hold_is_refused(info, error):
    with pytest.raises(error):
        Rig().intake.camera(info())
