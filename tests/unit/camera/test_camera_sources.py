"""Which source a word means, and what is said of one that cannot be used."""

import contextlib
import struct
import sys
import time

import cv2
import numpy as np
import pytest

from dfvs_core.errors import ImageError
from dfvs_core.messages.image import encode_png
from dfvs_service.camera import cli
from dfvs_service.camera.sources import capture
from dfvs_service.camera.sources.capture import CaptureSource, buffer_time_ns
from dfvs_service.camera.sources.source import ImageSource, SourceOptions, open_source
from dfvs_service.camera.sources.spec import (
    STAMPED_ON_ARRIVAL,
    CameraError,
    SourceKind,
    SourceLostError,
    SourceSpec,
    parse_source,
)

S = 1_000_000_000
LATE = ("--latency-ms", "80")
FOV = tuple(f"--set=camera.{name}" for name in ("width=64", "height=48", "horizontal_fov_deg=75"))


@pytest.fixture
def video(tmp_path, rng):
    """Twelve grey pictures at 25 Hz, each brighter than the one before."""
    path = tmp_path / "clip.avi"
    writer = cv2.VideoWriter(str(path), cv2.VideoWriter.fourcc(*"MJPG"), 25.0, (64, 48))
    for level in range(12):
        writer.write(np.full((48, 64, 3), 20 * level, np.uint8))
    writer.release()
    return path


@pytest.mark.parametrize(
    ("word", "kind", "place"),
    [
        ("0", SourceKind.V4L2, "/dev/video0"),
        ("/dev/video12", SourceKind.V4L2, "/dev/video12"),
        ("/dev/v4l/by-id/usb-cam-index0", SourceKind.V4L2, "/dev/v4l/by-id/usb-cam-index0"),
        ("rtsp://192.168.1.2:8554/main", SourceKind.STREAM, "rtsp://192.168.1.2:8554/main"),
        ("HTTP://host/x.mjpg", SourceKind.STREAM, "HTTP://host/x.mjpg"),
        ("picamera", SourceKind.PICAMERA, "0"),
        ("picamera2:1", SourceKind.PICAMERA, "1"),
        ("gst:videotestsrc", SourceKind.GSTREAMER, "videotestsrc"),
        ("videotestsrc ! appsink", SourceKind.GSTREAMER, "videotestsrc ! appsink"),
    ],
)
def test_a_word_names_a_source(word, kind, place):
    assert parse_source(word) == SourceSpec(kind, place)


def test_files_are_told_from_folders_and_pictures(tmp_path, video):
    picture = tmp_path / "a.PNG"
    picture.write_bytes(b"x")
    assert parse_source(str(tmp_path)).kind is SourceKind.IMAGES
    assert parse_source(str(picture)).kind is SourceKind.IMAGES
    assert parse_source(str(video)).kind is SourceKind.VIDEO


def test_a_word_that_names_nothing_is_refused():
    with pytest.raises(CameraError, match=r"no source 'camera0'.*rtsp"):
        parse_source("camera0")


def test_a_source_that_the_system_refuses_is_an_error_of_ours():
    with pytest.raises(CameraError, match="cannot be read"):
        parse_source("x" * 5000)


@pytest.mark.parametrize(
    ("word", "problem"),
    [
        ("97", "there is no camera /dev/video97"),
        ("rtsp://127.0.0.1:9/x", r"rtsp://127\.0\.0\.1:9/x cannot be opened"),
        ("rtsp://pilot:secret@127.0.0.1:9/x", r"rtsp://pilot:\*\*\*@127\.0\.0\.1:9/x cannot"),
    ],
    ids=["not plugged in", "not served", "with a password, which is not shown"],
)
def test_a_live_source_that_cannot_be_opened_may_come_back(word, problem):
    with pytest.raises(SourceLostError, match=problem):
        open_source(parse_source(word), SourceOptions())


@pytest.mark.parametrize(
    ("source", "hidden"),
    [
        ("rtsp://pilot:se:cret@127.0.0.1:9/x", ":***@"),
        ("rtsp://pilot:se@cret@127.0.0.1:9/x", ":***@"),
        ("rtsp://pilot@example.org:secret@127.0.0.1:9/x", ":***@"),
        ("gst:rtspsrc location=rtsp://a:b@h ! appsink", ":***@"),
        ("gst:rtspsrc location=rtsp://h user-id=a user-pw=secret ! appsink", "user-pw=*** !"),
        ('gst:rtspsrc location=rtsp://h user-pw="se cret" ! appsink', "user-pw=*** !"),
    ],
)
def test_the_password_of_a_stream_stays_out_of_what_is_shown(source, hidden):
    spec = parse_source(source)
    assert hidden in str(spec)
    assert "cret" not in str(spec) + spec.shown
    assert "a:b@" not in str(spec) + spec.shown
    assert spec.place == source.removeprefix("gst:")


@pytest.mark.skipif(
    "GStreamer:                   YES" in cv2.getBuildInformation(), reason="has GStreamer"
)
def test_opencv_without_gstreamer_is_named_as_the_cause():
    with pytest.raises(CameraError, match=r"built without GStreamer.*PyPI"):
        open_source(parse_source("gst:videotestsrc ! appsink"), SourceOptions())


def test_picamera2_that_is_not_installed_is_named_as_the_cause():
    with pytest.raises(CameraError, match="Picamera2 is not installed"):
        open_source(parse_source("picamera"), SourceOptions())


def test_picamera2_that_was_built_for_another_numpy_is_named_as_the_cause(tmp_path, monkeypatch):
    problem = "numpy.dtype size changed, may indicate binary incompatibility"
    (tmp_path / "picamera2.py").write_text(f"raise ValueError({problem!r})\n")
    monkeypatch.syspath_prepend(tmp_path)
    with pytest.raises(CameraError, match=r"size changed.*simplejpeg"):
        open_source(parse_source("picamera"), SourceOptions())


def test_a_pi_camera_that_does_not_start_is_given_back_to_be_tried_again(tmp_path, monkeypatch):
    (tmp_path / "picamera2.py").write_text(
        "class Picamera2:\n"
        "    taken = False\n"
        "    def __init__(self, number):\n"
        "        if Picamera2.taken: raise RuntimeError('Device or resource busy')\n"
        "        Picamera2.taken = True\n"
        "    global_camera_info = staticmethod(lambda: [{}])\n"
        "    create_video_configuration = lambda self, **_: {}\n"
        "    configure = lambda self, _: None\n"
        "    def start(self): raise RuntimeError('Camera frontend has timed out')\n"
        "    def close(self): Picamera2.taken = False\n"
    )
    monkeypatch.syspath_prepend(tmp_path)
    for _ in range(2):
        with pytest.raises(SourceLostError, match="timed out"):
            open_source(parse_source("picamera"), SourceOptions())
    monkeypatch.delitem(sys.modules, "picamera2")


def test_a_file_that_is_no_video_is_refused(tmp_path):
    path = tmp_path / "clip.mp4"
    path.write_bytes(b"no video" * 99)
    with pytest.raises(CameraError, match=r"clip\.mp4 cannot be read"):
        open_source(parse_source(str(path)), SourceOptions())


def test_a_video_gives_all_its_pictures_in_order_and_then_ends(video):
    source = CaptureSource(parse_source(str(video)), SourceOptions())
    levels = []
    while (shot := source.read()) is not None:
        assert shot.image.shape == (48, 64, 3)
        levels.append(float(shot.image.mean()))
    source.close()
    assert source.rate_hz == pytest.approx(25.0)
    assert levels == pytest.approx([20.0 * i for i in range(12)], abs=2.0)


def test_a_folder_gives_its_pictures_by_name(tmp_path):
    for name, level in (("b.png", 200), ("a.png", 100), ("notes.txt", 0)):
        (tmp_path / name).write_bytes(encode_png(np.full((16, 16, 3), level, np.uint8)))
    source = ImageSource(str(tmp_path))
    assert [int(source.read().image[0, 0, 0]) for _ in range(2)] == [100, 200]
    assert source.read() is None


def test_an_empty_folder_and_a_damaged_picture_are_named(tmp_path):
    with pytest.raises(CameraError, match="no images in"):
        ImageSource(str(tmp_path))
    (tmp_path / "x.jpg").write_bytes(b"\xff\xd8\xff nothing")
    with pytest.raises(ImageError, match=r"x\.jpg cannot be used"):
        ImageSource(str(tmp_path)).read()


def test_a_driver_s_stamp_is_believed_only_if_it_can_be_true():
    now_ns = 1000 * S
    assert buffer_time_ns(999_980.0, now_ns) == 999_980 * 1_000_000
    for nonsense_ms in (0.0, -1.0, 1_000_001.0, 990_000.0, 1.7e12):
        assert buffer_time_ns(nonsense_ms, now_ns) is None


def test_a_video_s_note_on_how_to_turn_it_does_not_count(tmp_path):
    path = tmp_path / "clip.mp4"
    writer = cv2.VideoWriter(str(path), cv2.VideoWriter.fourcc(*"mp4v"), 10.0, (64, 48))
    image = np.zeros((48, 64, 3), np.uint8)
    image[:12] = 255
    writer.write(image)
    writer.release()
    data, one = bytearray(path.read_bytes()), 1 << 16
    at = data.index(b"tkhd") + 44  # the track's matrix (ISO 14496-12), version 0
    data[at : at + 36] = struct.pack(">9i", 0, one, 0, -one, 0, 0, 48 * one, 0, 1 << 30)
    path.write_bytes(data)
    with contextlib.closing(CaptureSource(parse_source(str(path)), SourceOptions())) as source:
        turned = source.read().image
    assert turned.shape == (48, 64, 3)
    assert turned[:8].mean() > 200


class UnstampedCapture:
    """OpenCV's capture of a driver without stamps."""

    def grab(self):
        return True

    def retrieve(self):
        return True, np.zeros((48, 64, 3), np.uint8)

    def get(self, _property):
        return 0.0


@pytest.mark.parametrize("kind", sorted(STAMPED_ON_ARRIVAL))
def test_the_latency_counts_wherever_the_time_of_capture_is_not_told(kind, monkeypatch):
    monkeypatch.setattr(capture, "_opened", lambda *_: UnstampedCapture())
    source = CaptureSource(SourceSpec(kind, "0"), SourceOptions(latency_ns=S))
    before_ns = time.monotonic_ns()
    t_ns = source.read().t_capture_ns
    assert before_ns <= t_ns + S <= time.monotonic_ns()


@pytest.mark.parametrize("word", ["picamera", "."])
def test_a_latency_of_a_source_that_tells_the_time_of_capture_is_refused(word, refused):
    line = refused(cli.main, "goal", "--source", word, *LATE, *FOV, "--out", "goal.png")
    assert "--latency-ms beside" in line


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (("0", "--loop"), "--loop beside V4L2 device /dev/video0"),
        (("rtsp://a:b@127.0.0.1:9/x", "--rate", "5"), "--rate beside stream rtsp://a:***@127"),
        (("gst:videotestsrc ! appsink", "--rate", "5"), "--rate beside GStreamer pipeline"),
        ((".", "--format", "raw", "--quality", "50"), "--quality beside --format raw"),
    ],
)
def test_an_option_without_effect_on_the_source_is_refused(words, message, refused):
    assert message in refused(cli.main, "--source", *words)
