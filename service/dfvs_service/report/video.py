"""Video of a flight: view with its flow, goal, gate state and numbers.

VP8 in WebM: of the codecs that browsers play and OpenCV's wheels can write it is the fastest one.
"""

import math
import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import cv2
import numpy as np

from dfvs_core.errors import ConfigError
from dfvs_core.geometry.arrays import ImageArray
from dfvs_core.matching.warping import flow_at_size
from dfvs_service.image_drawing import (
    INK,
    LINE_PX,
    PAPER,
    SOFT,
    WHITE,
    draw_flow,
    draw_flow_key,
    resized,
    write_text,
)
from dfvs_service.report.flight import Flight, FlightView
from dfvs_service.report.series import FlightSeries, value_at

_CODEC = "VP80"
_VIEW_WIDTH, _SIDE_WIDTH = 480, 240
_ARROW_STRIDE_PX = 48
_OLD_S = 0.3
"""A view that is older is shown with its age."""
_COLOURS = {
    "SERVO": (9, 105, 218),
    "HOLD": (191, 135, 0),
    "DONE": (26, 127, 55),
    "ABORT": (207, 34, 46),
    "ENGAGE": (130, 80, 223),
}
_GREY = (110, 119, 129)


class VideoWriter:
    """Writes the video of a flight, at an even rate and in its own time.

    ``path`` ends in ``.webm``, and is there once the video is whole.
    """

    def __init__(self, path: Path, flight: Flight, rate_hz: int) -> None:
        self._path = path
        self._partial = path.with_name(f".{path.stem}.part.webm")
        self._flight = flight
        self._line = flight.line
        self._rate_hz = rate_hz
        self._tick = 0
        self._view: FlightView | None = None
        self._image: ImageArray | None = None
        self._height = 0
        self._writer: cv2.VideoWriter | None = None

    def add(self, view: FlightView) -> None:
        """Take the next view; views must come in the order of their time.

        Raises
        ------
        ConfigError
            If the video cannot be written.
        """
        if self._writer is None:
            self._begin(view)
            self._view = FlightView(math.nan, np.zeros_like(view.image))
        self._show_until(view.t_s)
        self._view, self._image = view, None

    def close(self) -> bool:
        """Put the video in the place of an older one; returns whether there is one.

        Raises
        ------
        ConfigError
            If it cannot be written.
        """
        self._show_until(self._line.to_s)
        if self._writer is None:
            self._path.unlink(missing_ok=True)
            return False
        self._writer.release()
        if _frames_in(self._partial) < self._tick:
            raise ConfigError(f"{self._path} cannot be written", "room on the disk")
        try:
            os.replace(self._partial, self._path)
        except OSError as error:
            raise ConfigError(f"{self._path} cannot be written ({error.strerror})") from error
        return True

    def abandon(self) -> None:
        """Leave nothing of this video behind, and an older one as it was."""
        if self._writer is not None:
            self._writer.release()
        self._partial.unlink(missing_ok=True)

    def _begin(self, view: FlightView) -> None:
        height, width = view.image.shape[:2]
        self._height = 2 * round(height * _VIEW_WIDTH / width / 2)
        with _quiet():
            writer = cv2.VideoWriter(
                str(self._partial),
                cv2.CAP_FFMPEG,
                cv2.VideoWriter.fourcc(*_CODEC),
                self._rate_hz,
                (_VIEW_WIDTH + _SIDE_WIDTH, self._height),
            )
        if not writer.isOpened():
            raise ConfigError(
                f"no video can be written to {self._path}",
                "a writable folder, and an OpenCV that writes VP8 as its wheels do",
            )
        self._writer = writer

    def _show_until(self, t_s: float) -> None:
        """Write frames up to a time, with the newest view."""
        while self._view is not None and self._writer is not None:
            now_s = self._line.from_s + self._tick / self._rate_hz
            if now_s >= t_s:
                return
            self._tick += 1
            if self._image is None:
                self._image = self._drawn(self._view)
            self._writer.write(self._frame(self._image, self._view, now_s)[:, :, ::-1])

    def _drawn(self, view: FlightView) -> ImageArray:
        size = (self._height, _VIEW_WIDTH)
        image = resized(view.image, size)
        limits = self._flight.limits
        if view.flow is None or limits is None:
            return image
        flow = flow_at_size(view.flow, size)
        return draw_flow(image, flow, limits.min_confidence, _ARROW_STRIDE_PX)

    def _frame(self, image: ImageArray, view: FlightView, now_s: float) -> ImageArray:
        """Frame (H, W, 3) RGB of a time."""
        height = self._height
        frame = np.full((height, _VIEW_WIDTH + _SIDE_WIDTH, 3), PAPER, np.uint8)
        frame[:, :_VIEW_WIDTH] = image
        goal = self._flight.goal_at(now_s)
        top = 0
        if goal is not None:
            goal_height = round(goal.shape[0] * _SIDE_WIDTH / goal.shape[1])
            top = min(goal_height, height // 2)
            frame[:top, _VIEW_WIDTH:] = resized(goal, (top, _SIDE_WIDTH))
            write_text(frame, "goal", (_VIEW_WIDTH + 8, top - 8), WHITE, shaded=True)
        age_s = now_s - view.t_s
        if not age_s <= _OLD_S:
            age = f"view {age_s:.1f} s old" if math.isfinite(age_s) else "no view yet"
            write_text(frame, age, (8, 18), WHITE, shaded=True)
        self._write_numbers(frame, top, now_s)
        return frame

    def _write_numbers(self, frame: ImageArray, top: int, now_s: float) -> None:
        """Write state, time and numbers below the goal."""
        state = self._flight.state_at(now_s)
        x, y = _VIEW_WIDTH + 10, top + 10
        colour = _COLOURS.get(state, _GREY)
        cv2.rectangle(frame, (x, y), (x + 98, y + 24), colour, -1)
        write_text(frame, state or "IDLE", (x + 8, y + 17), WHITE)
        write_text(frame, f"{now_s:.1f} s", (x + 112, y + 17), INK)
        y += 24 + LINE_PX + 3
        for name, value in _numbers(self._flight.series, now_s):
            write_text(frame, name, (x, y), SOFT)
            write_text(frame, value, (x + 84, y), INK)
            y += LINE_PX
        if self._view is not None and self._view.flow is not None:
            draw_flow_key(frame, (x, y))


def _frames_in(path: Path) -> int:
    """Frames that can be read from a video; its header may tell of more than the disk took."""
    frames = 0
    with _quiet():
        video = cv2.VideoCapture(str(path))
        while video.grab():
            frames += 1
    return frames


@contextmanager
def _quiet() -> Iterator[None]:
    """Without what OpenCV prints to the standard error: no tag for a codec, a file cut short."""
    kept, nowhere = os.dup(2), os.open(os.devnull, os.O_WRONLY)
    os.dup2(nowhere, 2)
    try:
        yield
    finally:
        os.dup2(kept, 2)
        os.close(kept)
        os.close(nowhere)


def _numbers(series: FlightSeries, now_s: float) -> list[tuple[str, str]]:
    """Lines of a frame; the velocities are forward, right and down."""

    def number(value: float, form: str, unit: str) -> str:
        return f"{value:{form}} {unit}" if math.isfinite(value) else "--"

    def vector(curves: tuple[list[tuple[float, float]], ...]) -> str:
        values = [value_at(curve, now_s) for curve in curves[:3]]
        return " ".join(f"{v:+.2f}" if math.isfinite(v) else "--" for v in values)

    return [
        ("distance", number(value_at(series.error_m, now_s), ".3f", "m")),
        ("angle", number(value_at(series.error_deg, now_s), ".1f", "deg")),
        ("told, m/s", vector(series.commanded)),
        ("flown, m/s", vector(series.flown)),
    ]
