"""Intrinsics and distortion recovered from boards that were seen through a known lens."""

import functools
import json

import cv2
import numpy as np
import pytest
from board_pictures import board_picture, board_poses

from dfvs_core.errors import ConfigError, GeometryError
from dfvs_core.geometry.camera import CameraModel
from dfvs_core.geometry.poses import rotation_from_euler
from dfvs_core.messages.image import encode_png
from dfvs_service.camera import cli
from dfvs_service.camera.calibration import command
from dfvs_service.camera.calibration.boards import Board, BoardView, parse_board
from dfvs_service.camera.calibration.coverage import coverage_of
from dfvs_service.camera.calibration.intrinsics import calibrate
from dfvs_service.frames import CapturedImage
from dfvs_service.settings.calibration_file import read_calibration

CAMERA = CameraModel(480, 360, 402.0, 398.5, 246.3, 174.8, (-0.21, 0.08, 0.0012, -0.0009, 0.0))
BOARDS = {"charuco": "charuco:7x5:0.04:0.03", "chessboard": "chessboard:8x6:0.03"}
VIEWS = 18


@functools.cache
def pictures(kind):
    rng = np.random.default_rng(5)
    board = Board(parse_board(BOARDS[kind]))
    # A ChArUco board may hang out of the picture, a chessboard must be in it whole.
    poses = board_poses(CAMERA, board, VIEWS, rng, 0.35 if kind == "charuco" else 0.7)
    return board, [board_picture(board, CAMERA, pose, rng) for pose in poses]


@pytest.fixture(scope="module", params=sorted(BOARDS))
def found(request):
    board, images = pictures(request.param)
    views = [board.find(image, f"{i}.png") for i, image in enumerate(images)]
    return [view for view in views if view is not None]


def greatest_difference_px(a, b, margin=0.0):
    """How far apart two cameras see the same rays, but for a margin (a share of the size)."""
    low, high = np.array(a.size) * margin, np.array(a.size) * (1.0 - margin)
    pixels = a.grid(20).reshape(-1, 2)
    pixels = pixels[((pixels >= low) & (pixels <= high)).all(axis=1)]
    return np.linalg.norm(b.denormalise(a.normalise(pixels)) - pixels, axis=-1).max()


def test_most_boards_are_found(found):
    assert len(found) >= 14


def test_the_lens_is_recovered(found):
    result = calibrate(found, CAMERA.size, "plumb_bob")
    camera = result.camera
    assert result.rms_px < 0.2
    # Half a per cent of the focal length; a pixel wherever a whole board can be shown.
    assert camera.fx == pytest.approx(CAMERA.fx, rel=0.005)
    assert camera.fy == pytest.approx(CAMERA.fy, rel=0.005)
    assert greatest_difference_px(CAMERA, camera, margin=0.15) < 1.0
    truth = np.array([CAMERA.fx, CAMERA.fy, CAMERA.cx, CAMERA.cy])
    error = np.array([camera.fx, camera.fy, camera.cx, camera.cy]) - truth
    # What it says of its own uncertainty holds.
    assert (np.abs(error) < 4 * np.array(result.deviations_px)).all()


def exact_views(project):
    """Boards whose corners (N, 3) m are exactly where they are projected to."""
    rng = np.random.default_rng(5)
    board = Board(parse_board(BOARDS["chessboard"]))
    x, y = np.meshgrid(np.arange(-3, 4) * 0.03, np.arange(-2, 3) * 0.03)
    points = np.stack([x.ravel(), y.ravel(), np.zeros(35)], axis=1)
    views = []
    for i, pose in enumerate(board_poses(CAMERA, board, 12, rng)):
        pixels = project(points @ pose[:3, :3].T + pose[:3, 3]) - 0.5  # OpenCV's origin
        views.append(BoardView(str(i), points.astype(np.float32), pixels.astype(np.float32)))
    return views


def test_exact_corners_give_the_lens_back_with_our_pixel_centres():
    camera = calibrate(exact_views(CAMERA.project), CAMERA.size, "plumb_bob").camera
    assert greatest_difference_px(CAMERA, camera) < 0.01


def test_a_fit_that_folds_back_in_the_image_is_refused():
    def project(points):
        xy = points[:, :2] / points[:, 2:] / 3.0  # in the middle of the image alone
        radial = 1.0 - 1.5 * (xy**2).sum(axis=1, keepdims=True)
        return 400.0 * xy * radial + [240.0, 180.0]

    with pytest.raises(GeometryError, match="folds back in the image"):
        calibrate(exact_views(project), CAMERA.size, "plumb_bob")


def test_a_pinhole_fit_has_no_distortion_and_says_by_its_error_that_it_is_none(found):
    result = calibrate(found, CAMERA.size, "pinhole")
    assert result.camera.distortion == ()
    assert result.rms_px > 2 * calibrate(found, CAMERA.size, "plumb_bob").rms_px


def test_a_picture_that_does_not_fit_is_left_out(found):
    bent = found[3].pixels + 25 * np.sin(found[3].pixels[:, ::-1] / 20)
    views = [*found[:3], BoardView("bent", found[3].points_m, bent.astype(np.float32)), *found[4:]]
    result = calibrate(views, CAMERA.size, "plumb_bob")
    assert [view.name for view in result.views if not view.is_used] == ["bent"]
    assert result.camera.fx == pytest.approx(CAMERA.fx, rel=0.005)
    assert "did not fit" in " ".join(result.doubts())


def test_too_few_pictures_are_refused(found):
    with pytest.raises(ConfigError, match="4 usable images"):
        calibrate(found[:4], CAMERA.size, "plumb_bob")


def flat_view(tilt_deg=(0.0, 0.0)):
    """A board's corners through a pinhole, without a picture."""
    x, y = np.meshgrid(np.arange(6) * 0.04, np.arange(4) * 0.04)
    points = np.stack([x.ravel(), y.ravel(), np.zeros(24)], axis=1)
    R = rotation_from_euler(*np.radians(tilt_deg), 0.0)
    placed = (points - points.mean(axis=0)) @ R.T + [0, 0, 0.6]
    pixels = placed[:, :2] / placed[:, 2:] * 576 + [320, 240]
    return BoardView("view", points.astype(np.float32), pixels.astype(np.float32))


def test_advice_names_what_is_missing():
    advice = " | ".join(coverage_of([flat_view()], (640, 480)).advice())
    assert "take 11 more images" in advice
    assert "top left" in advice
    assert "hold it so near" in advice


@pytest.mark.parametrize("tilt_deg", [(0, 25), (0, -25), (25, 0), (-25, 0)])
def test_tilts_are_told_apart(tilt_deg):
    view = flat_view(tilt_deg)
    tilts = coverage_of([view], (640, 480)).tilts
    assert sum(tilts.values()) == 1
    (found,) = [key for key, count in tilts.items() if count]
    corners = view.pixels.reshape(4, 6, 2)
    left, right = np.ptp(corners[:, 0, 1]), np.ptp(corners[:, -1, 1])
    top, bottom = np.ptp(corners[0, :, 0]), np.ptp(corners[-1, :, 0])
    # What is turned away looks smaller.
    smaller = {
        "left": left < right,
        "right": right < left,
        "up": top < bottom,
        "down": bottom < top,
    }
    assert smaller[found]


@pytest.mark.parametrize(
    ("word", "message"),
    [
        ("charuco:7x5:0.04", "--board is"),
        ("chessboard:7x5:0.04:0.03", "--board is"),
        ("charuco:2x5:0.04:0.03", "3 to 40"),
        ("charuco:7x5:0.04:0.05", "markers of"),
        ("chessboard:7x5:4", "squares of 4 m"),
        ("charuco:7x5:0.04:0.03:9X9_1", "dictionary"),
        ("chessboard:7x5:1.1.1", "in metres"),
        ("board", "--board is"),
    ],
)
def test_boards_that_cannot_be_are_refused(word, message):
    with pytest.raises(ConfigError, match=message):
        parse_board(word)


def test_the_command_goes_from_a_folder_to_a_file_that_the_service_reads(tmp_path, capsys):
    _, images = pictures("charuco")
    folder = tmp_path / "pictures"
    folder.mkdir()
    for i, image in enumerate(images):
        (folder / f"{i:02d}.png").write_bytes(encode_png(image))
    (folder / "zz.png").write_bytes(encode_png(np.full_like(images[0], 90)))
    out = tmp_path / "camera.TOML"
    words = ["calibrate", "--board", BOARDS["charuco"], "--source", str(folder), "--out", str(out)]
    assert cli.main([*words, "--json"]) in (0, 1)
    printed, told = capsys.readouterr()
    assert "zz.png: no board" in told
    report = json.loads(printed)
    assert json.loads(out.with_suffix(".json").read_text()) == report
    assert report["rms_px"] < 0.2
    assert len(report["pictures"]) == len(images)
    assert greatest_difference_px(CAMERA, read_calibration(out)) < 1.5
    plot = cv2.imread(str(out.with_suffix(".png")))
    assert plot.shape[1] > 600
    assert (plot[..., 1].astype(int) - plot[..., 2] > 60).sum() > 500  # green corners and bars


@pytest.mark.parametrize(("columns", "rows", "is_made"), [(10, 10, True), (12, 9, False)])
def test_a_board_has_no_more_markers_than_its_dictionary(columns, rows, is_made, tmp_path, refused):
    words = ("board", "--board", f"charuco:{columns}x{rows}:0.02:0.015:4X4_50", "--out")
    if is_made:
        assert cli.main([*words, str(tmp_path / "board.png")]) == 0
    else:
        assert "54 markers" in refused(cli.main, *words, tmp_path / "board.png")


def test_a_board_is_a_png(tmp_path, refused):
    path = tmp_path / "board.pdf"
    words = ("board", "--board", BOARDS["charuco"], "--out", path)
    assert "board.pdf'; expected a name that ends in .png" in refused(cli.main, *words)
    assert not path.exists()


def test_a_printed_board_is_found_again(tmp_path, capsys):
    path = tmp_path / "board.png"
    assert (
        cli.main(["board", "--board", BOARDS["charuco"], "--dpi", "100", "--out", str(path)]) == 0
    )
    assert "39.88 mm" in capsys.readouterr().out
    image = cv2.cvtColor(cv2.imread(str(path)), cv2.COLOR_BGR2RGB)
    view = Board(parse_board(BOARDS["charuco"])).find(image, "printed")
    assert len(view.pixels) == 24


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["--board", "charuco:7x5:0.04:0.03", "--out", "x.json"], "ends in .toml"),
        (["--board", "nothing", "--out", "x.toml"], "--board is"),
        (["--board", "charuco:7x5:0.04:0.03", "--out", "x.toml"], "0 usable images"),
    ],
)
def test_what_cannot_be_calibrated_is_one_line(tmp_path, capsys, words, message):
    (tmp_path / "a.png").write_bytes(encode_png(np.full((48, 64, 3), 90, np.uint8)))
    words = [word.replace("x.toml", str(tmp_path / "x.toml")) for word in words]
    assert cli.main(["calibrate", "--source", str(tmp_path), *words]) == 2
    lines = capsys.readouterr().err.splitlines()
    assert message in lines[-1]
    assert lines[-1].startswith("error: ")
    assert sorted(p.name for p in tmp_path.iterdir()) == ["a.png"]


def write_video(path, images):
    writer = cv2.VideoWriter(str(path), cv2.VideoWriter.fourcc(*"MJPG"), 200.0, CAMERA.size)
    for image in images:
        for _ in range(2):  # a board that is held still is no new view
            writer.write(image)
    writer.release()


def test_a_refused_fit_keeps_the_images_of_a_moving_source(tmp_path, capsys):
    board, images = pictures("charuco")
    write_video(tmp_path / "board.avi", images[:4])
    words = ["calibrate", "--board", BOARDS["charuco"], "--source", str(tmp_path / "board.avi")]
    assert cli.main([*words, "--out", str(tmp_path / "camera.toml")]) == 2
    (folder,) = tmp_path.glob("camera-images-*")
    error = capsys.readouterr().err.splitlines()[-1]
    assert "4 usable images" in error
    assert error.endswith(f"--source {folder}")
    kept = [cv2.imread(str(path)) for path in sorted(folder.iterdir())]
    assert len(kept) == 4
    assert all(board.find(image, "") is not None for image in kept)


class ChangingFeed:
    """Images without a board, the second one smaller, as of a camera that was lost and is back."""

    ended = False

    def __init__(self):
        self._heights = [360, 288]

    def receive(self, timeout_s):
        height = self._heights.pop(0)
        return CapturedImage(np.full((height, height * 4 // 3, 3), 90, np.uint8), 0)

    def close(self):
        pass


def test_a_source_that_changes_its_size_is_refused(tmp_path, monkeypatch, refused):
    monkeypatch.setattr(command, "feed_of", lambda arguments, wanted: ChangingFeed())
    words = ("calibrate", "--board", BOARDS["charuco"], "--source", "0")
    line = refused(cli.main, *words, "--out", tmp_path / "camera.toml")
    assert "the source gives 384 x 288 px; expected 480 x 360 px" in line
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("name", ["board.avi", "."])
def test_images_of_another_size_than_asked_for_are_not_calibrated(name, tmp_path, refused):
    images = pictures("charuco")[1][:2]
    write_video(tmp_path / "board.avi", images)
    (tmp_path / "board.png").write_bytes(encode_png(images[0]))
    words = ("calibrate", "--board", BOARDS["charuco"], "--source", tmp_path / name)
    line = refused(cli.main, *words, "--size", "640x480", "--out", tmp_path / "camera.toml")
    assert "480 x 360 px; expected 640 x 480 px" in line


def test_from_a_moving_source_only_new_views_are_taken_and_what_is_missing_is_said(
    tmp_path, capsys
):
    _, images = pictures("charuco")
    path = tmp_path / "board.avi"
    write_video(path, images)
    out = tmp_path / "camera.toml"
    words = ["calibrate", "--board", BOARDS["charuco"], "--source", str(path), "--out", str(out)]
    assert cli.main([*words, "--json"]) in (0, 1)
    printed, told = capsys.readouterr()
    count = len(json.loads(printed)["pictures"])
    assert 12 <= count <= len(images)
    assert "camera: image 1: " in told
    assert "more" in told.splitlines()[0]
    assert read_calibration(out).fx == pytest.approx(CAMERA.fx, rel=0.01)


@pytest.mark.parametrize(
    ("out", "told"),
    [
        ("folder.toml", "folder.toml is a folder"),
        ("taken.toml", "taken.png is a folder"),
        ("none/camera.toml", "lies in no folder"),
        ("/proc/self/camera.toml", "cannot be written"),
    ],
)
def test_files_that_cannot_be_written_are_refused_before_the_images(out, told, tmp_path, refused):
    for name in ("folder.toml", "taken.png"):
        (tmp_path / name).mkdir()
    words = ["calibrate", "--board", BOARDS["charuco"], "--source", tmp_path / "no-such-source"]
    assert told in refused(cli.main, *words, "--out", tmp_path / out)
