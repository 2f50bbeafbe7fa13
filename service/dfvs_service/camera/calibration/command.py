"""``dfvs-camera calibrate`` and ``dfvs-camera board``."""

import argparse
import contextlib
import json
import signal
import tempfile
import threading
from collections.abc import Sequence
from pathlib import Path

import cv2
import numpy as np

from dfvs_common.atomic_file import replace_file
from dfvs_common.command_line import (
    command_parser,
    require_file,
    require_range,
    require_replaceable,
)
from dfvs_core.errors import ConfigError, GeometryError
from dfvs_core.messages.image import encode_png
from dfvs_service.camera.calibration.boards import Board, BoardView, parse_board
from dfvs_service.camera.calibration.coverage import coverage_of
from dfvs_service.camera.calibration.intrinsics import Calibration, calibrate
from dfvs_service.camera.calibration.report import coverage_image, report_document
from dfvs_service.camera.feed import Feed
from dfvs_service.camera.options import add_source_options, feed_of, log, source_options
from dfvs_service.camera.sources.source import check_size, image_paths
from dfvs_service.camera.sources.spec import SourceKind, parse_source
from dfvs_service.settings.calibration_file import write_calibration
from dfvs_service.settings.goal_file import read_image

_RECEIVE_S = 0.25
_NEW_SHARE = 0.06
"""A live image is kept if the board moved by this share of the image's width since the last."""

_MOST_VIEWS = 60
_EPILOG = """\
examples:
  dfvs-camera board --board charuco:7x5:0.04:0.03 --out board.png       print it, glue it flat
  dfvs-camera calibrate --board charuco:7x5:0.04:0.03 --source 0 --size 640x480 --out camera.toml
  dfvs-camera calibrate --board chessboard:9x6:0.025 --source images/ --out camera.toml

It writes camera.toml (for the service's settings), camera.json (report) and camera.png (coverage
and every image's error). From a live source, images are taken by themselves whenever the board
has moved; Ctrl-C ends with what there is. Exit code: 0 done, 1 done but doubtful, 2 cannot run.
"""


def _board_option(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "--board",
        required=True,
        metavar="BOARD",
        help="charuco:COLUMNSxROWS:SQUARE:MARKER[:DICTIONARY] or chessboard:COLUMNSxROWS:SQUARE, "
        "in squares, m",
    )


def run_board(words: Sequence[str]) -> int:
    """Draw a board to be printed; exit code 0.

    Raises
    ------
    ConfigError
        If there is no such board, or the file cannot be written.
    """
    parser = argparse.ArgumentParser(
        prog="dfvs-camera board",
        description="Draw a calibration board, ready to be printed at its true size.",
        epilog="example: dfvs-camera board --board charuco:7x5:0.04:0.03 --out board.png",
    )
    _board_option(parser)
    parser.add_argument("--dpi", type=int, default=300, help="of the printer (default: 300)")
    parser.add_argument("--out", type=Path, required=True, metavar="FILE", help="PNG to write")
    arguments = parser.parse_args(words)
    board = Board(parse_board(arguments.board))
    require_replaceable("--out", arguments.out, ".png")
    require_range(arguments, 50, 1200, "dpi")
    square_px = round(board.spec.square_m / 0.0254 * arguments.dpi)
    image = board.draw(square_px, square_px // 2)
    replace_file(arguments.out, encode_png(np.repeat(image[:, :, None], 3, axis=2)))
    side_mm = square_px / arguments.dpi * 25.4
    print(
        f"wrote {arguments.out}: print at {arguments.dpi} dpi; a square must measure "
        f"{side_mm:.2f} mm"
    )
    return 0


def run(words: Sequence[str]) -> int:
    """Calibrate; exit code 0, or 1 where the result is doubtful.

    Raises
    ------
    DfvsError
        If source, board or output cannot be used, or the images fix no camera.
    """
    arguments = _parser().parse_args(words)
    board = Board(parse_board(arguments.board))
    require_file("--out", arguments.out, ".toml")
    for path in _outputs(arguments.out):
        require_replaceable("--out", path)
    views, size, images = _collect(board, arguments)
    try:
        calibration = calibrate(views, size, arguments.lens)
    except (ConfigError, GeometryError) as error:
        if not images:
            raise
        kept = f"the images are kept: --source {_keep(images, arguments.out)}"
        remedy = "; ".join(filter(None, (error.remedy, kept)))
        raise ConfigError(error.problem, error.expected, remedy) from error
    document = report_document(calibration, coverage_of(views, size))
    _write(arguments.out, views, calibration, document)
    print(json.dumps(document) if arguments.json else _summary(arguments.out, document))
    return 1 if document["missing"] or document["doubts"] else 0


def _parser() -> argparse.ArgumentParser:
    parser = command_parser(
        "dfvs-camera calibrate", "Find a camera's intrinsics from images of a board.", _EPILOG
    )
    _board_option(parser)
    add_source_options(parser)
    parser.add_argument("--out", type=Path, required=True, metavar="FILE", help="TOML to write")
    parser.add_argument(
        "--lens",
        choices=("pinhole", "plumb_bob", "rational"),
        default="plumb_bob",
        help="distortion: none, 5 coefficients (default), or 8 for wide lenses",
    )
    parser.add_argument("--json", action="store_true", help="print the report as JSON")
    return parser


def _collect(
    board: Board, arguments: argparse.Namespace
) -> tuple[list[BoardView], tuple[int, int], list[bytes]]:
    """Views of the board, the images' size (width, height) px, and PNGs of those in no folder."""
    spec = parse_source(arguments.source)
    options = source_options(arguments, None)
    if spec.kind is SourceKind.IMAGES:
        return *_from_images(board, image_paths(spec.place), options.size), []
    stop = threading.Event()
    signal.signal(signal.SIGINT, lambda *_: stop.set())
    with contextlib.closing(feed_of(arguments, None)) as feed:
        return _from_feed(board, feed, stop, options.size)


def _from_images(
    board: Board, paths: Sequence[Path], size: tuple[int, int] | None
) -> tuple[list[BoardView], tuple[int, int]]:
    """Views from all images of a folder, which must be of one size: the wanted one, if any."""
    views: list[BoardView] = []
    for path in paths:
        image = read_image(path)
        size = check_size(image, size, str(path))
        view = board.find(image, path.name)
        log(f"{path.name}: {'no board' if view is None else f'{len(view.pixels)} corners'}")
        if view is not None:
            views.append(view)
    return views, size or (0, 0)


def _from_feed(
    board: Board, feed: Feed, stop: threading.Event, size: tuple[int, int] | None
) -> tuple[list[BoardView], tuple[int, int], list[bytes]]:
    """Views from a live source: one whenever the board has moved, until nothing is missing.

    All its images must be of one size, the given one where that is not None.
    """
    views: list[BoardView] = []
    images: list[bytes] = []
    while not stop.is_set() and not feed.ended and len(views) < _MOST_VIEWS:
        captured = feed.receive(_RECEIVE_S)
        if captured is None:
            continue
        size = check_size(captured.image, size, "the source")
        view = board.find(captured.image, f"image {len(views) + 1}")
        if view is None or not _is_new(view, views, size[0]):
            continue
        views.append(view)
        images.append(encode_png(captured.image))
        missing = coverage_of(views, size).advice()
        if not missing:
            log(f"image {len(views)}: enough")
            break
        log(f"image {len(views)}: {'; '.join(missing[:2])}")
    return views, size or (0, 0), images


def _keep(images: Sequence[bytes], out: Path) -> Path:
    """Write PNGs to a new folder beside the output; returns the folder."""
    folder = Path(tempfile.mkdtemp(prefix=f"{out.stem}-images-", dir=out.parent))
    for number, image in enumerate(images, 1):
        (folder / f"{number:02d}.png").write_bytes(image)
    return folder


def _is_new(view: BoardView, views: Sequence[BoardView], width: int) -> bool:
    """Whether the board is elsewhere, or tilted otherwise, than in every image so far."""
    outline = _outline(view)
    return all(np.abs(outline - _outline(other)).max() > _NEW_SHARE * width for other in views)


def _outline(view: BoardView) -> np.ndarray[tuple[int, ...], np.dtype[np.float32]]:
    """Four corners of the board's bounding box and the extent of its diagonals, px."""
    u, v = view.pixels[:, 0], view.pixels[:, 1]
    return np.array([u.min(), u.max(), v.min(), v.max(), (u + v).min(), (u - v).max()], np.float32)


def _outputs(out: Path) -> tuple[Path, Path, Path]:
    """Calibration, report and coverage."""
    return out, out.with_suffix(".json"), out.with_suffix(".png")


def _write(
    out: Path, views: Sequence[BoardView], calibration: Calibration, document: dict[str, object]
) -> None:
    used = sum(view.is_used for view in calibration.views)
    remarks = [
        "Camera calibration by dfvs-camera calibrate (OpenCV " + cv2.__version__ + ")",
        f"{used} images, root mean square reprojection error {calibration.rms_px:.3f} px",
    ]
    toml, report, image = _outputs(out)
    write_calibration(toml, calibration.camera, remarks)
    replace_file(report, (json.dumps(document, indent=2) + "\n").encode())
    replace_file(image, encode_png(coverage_image(views, calibration)))


def _summary(out: Path, document: dict[str, object]) -> str:
    lines = ["wrote {}, {} and {}".format(*_outputs(out))]
    lines.append(f"root mean square error {document['rms_px']} px")
    for key, title in (("missing", "to be better"), ("doubts", "doubtful")):
        items = document[key]
        if isinstance(items, list):
            lines += [f"{title}: {item}" for item in items]
    return "\n".join(lines)
