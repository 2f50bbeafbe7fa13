"""Calibration boards: parsing, drawing and corner detection."""

import re
from dataclasses import dataclass
from typing import Literal

import cv2
import numpy as np

from dfvs_core.errors import ConfigError
from dfvs_core.geometry.arrays import Float32Array, ImageArray

_BOARD = re.compile(
    r"(?P<kind>charuco|chessboard):(?P<columns>\d+)x(?P<rows>\d+):(?P<square>[\d.]+)"
    r"(?::(?P<marker>[\d.]+)(?::(?P<dictionary>\w+))?)?"
)
_DICTIONARY = "5X5_100"
FEWEST_CORNERS = 8
_MOST_SHEET_PX = 200_000_000
"""Largest board that is drawn: A0 at 300 dpi has 140 million px."""


@dataclass(frozen=True, slots=True)
class BoardSpec:
    """A board of ``columns`` x ``rows`` squares; lengths in m, ``marker_m`` of ChArUco alone."""

    kind: Literal["charuco", "chessboard"]
    columns: int
    rows: int
    square_m: float
    marker_m: float = 0.0
    dictionary: str = _DICTIONARY

    def __post_init__(self) -> None:
        """Refuse boards that cannot be printed or found."""
        if not (3 <= self.columns <= 40 and 3 <= self.rows <= 40):
            raise ConfigError(f"a board of {self.columns} x {self.rows} squares", "3 to 40 each")
        if not 0.001 <= self.square_m <= 1.0:
            raise ConfigError(f"squares of {self.square_m:g} m", "0.001 to 1 m")
        if self.kind == "charuco" and not 0.3 <= self.marker_m / self.square_m <= 0.95:
            raise ConfigError(
                f"markers of {self.marker_m:g} m in squares of {self.square_m:g} m",
                "markers of 0.3 to 0.95 of the square",
            )
        if not hasattr(cv2.aruco, f"DICT_{self.dictionary}"):
            raise ConfigError(f"marker dictionary {self.dictionary!r}", "such as 5X5_100, 4X4_50")
        if self.kind == "charuco":
            self._check_markers()

    def _check_markers(self) -> None:
        """Find that the dictionary has a marker for every other square."""
        code = getattr(cv2.aruco, f"DICT_{self.dictionary}")
        wanted = self.columns * self.rows // 2
        known = len(cv2.aruco.getPredefinedDictionary(code).bytesList)
        if wanted > known:
            raise ConfigError(
                f"a board of {self.columns} x {self.rows} squares has {wanted} markers",
                f"at most {known}, as many as {self.dictionary} has",
                "choose fewer squares or a dictionary of more markers, such as 5X5_1000",
            )


def parse_board(text: str) -> BoardSpec:
    """Board of a command line: ``charuco:7x5:0.04:0.03[:5X5_100]`` or ``chessboard:9x6:0.025``.

    Raises
    ------
    ConfigError
        If it is none.
    """
    match = _BOARD.fullmatch(text)
    if match is None or (match["kind"] == "charuco") != (match["marker"] is not None):
        raise ConfigError(
            f"--board is {text!r}",
            "charuco:COLUMNSxROWS:SQUARE:MARKER[:DICTIONARY] or chessboard:COLUMNSxROWS:SQUARE, "
            "counted in squares and metres, such as charuco:7x5:0.04:0.03",
        )
    try:
        square_m, marker_m = float(match["square"]), float(match["marker"] or 0.0)
    except ValueError as error:
        raise ConfigError(f"--board is {text!r}", "lengths in metres") from error
    return BoardSpec(
        "charuco" if match["kind"] == "charuco" else "chessboard",
        int(match["columns"]),
        int(match["rows"]),
        square_m,
        marker_m,
        match["dictionary"] or _DICTIONARY,
    )


@dataclass(frozen=True, slots=True)
class BoardView:
    """A board in one image.

    ``points_m`` (N, 3) are its corners on the board. ``pixels`` (N, 2) are their places in px with
    OpenCV's origin: the first pixel's centre is (0, 0).
    """

    name: str
    points_m: Float32Array
    pixels: Float32Array


class Board:
    """Finds a board's corners, and draws it."""

    def __init__(self, spec: BoardSpec) -> None:
        self.spec = spec
        self._charuco: cv2.aruco.CharucoBoard | None = None
        if spec.kind == "charuco":
            code = getattr(cv2.aruco, f"DICT_{spec.dictionary}")
            dictionary = cv2.aruco.getPredefinedDictionary(code)
            size = (spec.columns, spec.rows)
            self._charuco = cv2.aruco.CharucoBoard(size, spec.square_m, spec.marker_m, dictionary)
            self._detector = cv2.aruco.CharucoDetector(self._charuco)

    def find(self, image: ImageArray, name: str) -> BoardView | None:
        """Corners in an image (H, W, 3) uint8 RGB; None where too few are seen."""
        grey = cv2.cvtColor(image, cv2.COLOR_RGB2GRAY).astype(np.uint8)
        found = self._find_chessboard(grey) if self._charuco is None else self._find_charuco(grey)
        if found is None or len(found[0]) < FEWEST_CORNERS or _on_a_line(found[0]):
            return None
        return BoardView(name, found[0], found[1])

    def _find_charuco(self, grey: ImageArray) -> tuple[Float32Array, Float32Array] | None:
        corners, ids, _, _ = self._detector.detectBoard(grey)
        if self._charuco is None or ids is None or len(ids) == 0:
            return None
        points = np.asarray(self._charuco.getChessboardCorners())[np.asarray(ids).reshape(-1)]
        pixels = np.asarray(corners, np.float32).reshape(-1, 2)
        return points.astype(np.float32), pixels

    def _find_chessboard(self, grey: ImageArray) -> tuple[Float32Array, Float32Array] | None:
        inner = (self.spec.columns - 1, self.spec.rows - 1)
        flags = cv2.CALIB_CB_NORMALIZE_IMAGE | cv2.CALIB_CB_EXHAUSTIVE | cv2.CALIB_CB_ACCURACY
        found, corners = cv2.findChessboardCornersSB(grey, inner, flags=flags)
        if not found:
            return None
        x, y = np.meshgrid(np.arange(inner[0]), np.arange(inner[1]))
        points = np.stack([x.ravel(), y.ravel(), np.zeros(x.size)], axis=1) * self.spec.square_m
        return points.astype(np.float32), np.asarray(corners, np.float32).reshape(-1, 2)

    def draw(self, square_px: int, margin_px: int = 0) -> ImageArray:
        """Image (H, W) of the board.

        Raises
        ------
        ConfigError
            If it is too large for an image, or its squares too small for the markers.
        """
        spec = self.spec
        size = (spec.columns * square_px + 2 * margin_px, spec.rows * square_px + 2 * margin_px)
        if size[0] * size[1] > _MOST_SHEET_PX:
            raise ConfigError(
                f"a sheet of {size[0]} x {size[1]} px",
                f"at most {_MOST_SHEET_PX // 1_000_000} million px",
                "choose a lower --dpi or smaller squares",
            )
        if self._charuco is not None:
            try:
                return np.asarray(self._charuco.generateImage(size, None, margin_px), np.uint8)
            except cv2.error as error:
                raise ConfigError(
                    f"squares of {square_px} px are too small for the markers",
                    "a px or more for each cell of a marker",
                    "choose a higher --dpi or larger squares",
                ) from error
        dark = np.add.outer(np.arange(spec.rows), np.arange(spec.columns)) % 2 == 0
        square = np.ones((square_px, square_px), np.uint8)
        squares = np.kron(np.where(dark, 0, 255).astype(np.uint8), square)
        return np.pad(squares, margin_px, constant_values=255)


def _on_a_line(points_m: Float32Array) -> bool:
    """Whether corners lie in one row: they fix no pose."""
    centred = points_m[:, :2] - points_m[:, :2].mean(axis=0)
    return bool(np.linalg.matrix_rank(centred, tol=1e-6) < 2)
