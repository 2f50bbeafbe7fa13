"""Reader of a flight from its black box."""

from collections.abc import Iterator
from pathlib import Path
from typing import Any

from dfvs_common.file_order import numbered
from dfvs_core.errors import DfvsError, WireError
from dfvs_core.gate.config import S
from dfvs_core.gate.events import (
    Attitude,
    BadReport,
    Event,
    ForeignSetpoint,
    LocalPosition,
    MonitorFailed,
    Report,
)
from dfvs_core.gate.replay import Step, read_start, read_steps
from dfvs_core.geometry.arrays import ImageArray
from dfvs_core.messages.image import decode_image
from dfvs_service.flights import layout
from dfvs_service.flights.records import read_lines, read_summary
from dfvs_service.report.flight import BLACK_BOX, Flight, FlightView
from dfvs_service.report.series import SeriesBuilder

_FAULTS = BadReport | ForeignSetpoint | MonitorFailed


class BlackBoxFlight:
    """Flight in a folder of the black box, as far as its records go."""

    video_rate_hz = 2
    note = (
        "The black box keeps one small view a second, and no flow: video and views are made "
        "of those. A recording (MCAP) has them all."
    )

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        self.name = folder.name
        header = next(read_lines(folder / layout.HEADER), {})
        start_ns = header.get("started_ns")
        self._start_ns = start_ns if isinstance(start_ns, int) else None

    def read(self) -> Flight:
        """Read all but the views."""
        builder = SeriesBuilder(self._start_ns or 0)
        if self._start_ns is not None:
            for step in _steps(self._folder / layout.GATE_INPUTS):
                _add_step(builder, step)
            for document in _servo_documents(self._folder):
                builder.add_servo(document)
        return Flight(
            summary=read_summary(self._folder),
            source=BLACK_BOX,
            start_ns=self._start_ns or 0,
            series=builder.series,
            settings=_text(self._folder / layout.SETTINGS),
            build=_text(self._folder / layout.BUILD),
            goals=self._goals(),
        )

    def views(self) -> Iterator[FlightView]:
        """Thumbnails, oldest first."""
        for t_s, image in self._images(layout.THUMBNAILS):
            yield FlightView(t_s, image)

    def _goals(self) -> tuple[tuple[float, ImageArray], ...]:
        first = _image(self._folder / "goal.png")
        known = () if first is None else ((0.0, first),)
        return (*known, *self._images(layout.GOALS))

    def _images(self, name: str) -> Iterator[tuple[float, ImageArray]]:
        """Images of a folder that are named by their monotonic time, with the time in s."""
        paths = [p for p in (self._folder / name).glob("*.jpg") if p.stem.isdecimal()]
        for path in sorted(paths, key=lambda path: int(path.stem)):
            image = _image(path)
            if image is not None and self._start_ns is not None:
                yield (int(path.stem) - self._start_ns) / S, image


def _add_step(builder: SeriesBuilder, step: Step) -> None:
    for event in step.events:
        _add_event(builder, event)
    velocity = step.encoded.get("v")
    if isinstance(velocity, list) and len(velocity) == 4:
        forward, right, down, yaw_rate = velocity
        builder.add_setpoint(step.t_ns, (forward, right, down, yaw_rate))


def _add_event(builder: SeriesBuilder, event: Event) -> None:
    if isinstance(event, Attitude):
        builder.add_yaw(event.t_ns, event.yaw_rad)
    elif isinstance(event, LocalPosition):
        builder.add_position(event.t_ns, event.position_m, event.velocity_m_s)
    elif isinstance(event, Report):
        builder.add_report(event.t_ns, event.report)
    elif isinstance(event, _FAULTS):
        builder.add_fault(event.t_ns, event.detail)


def _steps(path: Path) -> Iterator[Step]:
    """Recorded steps of the gate up to a damaged line or the end."""
    try:
        with path.open(encoding="utf-8", errors="replace") as lines:
            read_start(next(lines, ""))
            yield from (step for step in read_steps(lines) if isinstance(step, Step))
    except (OSError, WireError):
        return


def _servo_documents(folder: Path) -> Iterator[dict[str, Any]]:
    for path in sorted(folder.glob(f"{layout.TELEMETRY}-*.jsonl"), key=numbered):
        for record in read_lines(path):
            if record.get("stream") == "servo" and isinstance(record.get("data"), dict):
                yield record["data"]


def _image(path: Path) -> ImageArray | None:
    try:
        return decode_image(path.read_bytes())
    except (OSError, DfvsError):
        return None


def _text(path: Path) -> str:
    try:
        return path.read_text(encoding="utf-8", errors="replace").strip()
    except OSError:
        return "not recorded"
