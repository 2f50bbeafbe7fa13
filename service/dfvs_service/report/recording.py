"""Reader of a flight from its MCAP recording; a replay gives the flow."""

import json
from collections.abc import Iterator, Sequence
from pathlib import Path

from dfvs_core.errors import DfvsError
from dfvs_core.gate.config import S
from dfvs_core.geometry.arrays import ImageArray
from dfvs_core.matching.warping import flow_at_size
from dfvs_core.messages.frame_record import FrameRecord, SessionHeader
from dfvs_core.messages.image import decode_image
from dfvs_core.messages.link import GateStatus
from dfvs_service.flights.records import FlightSummary, StateChange, utc_time
from dfvs_service.frames import record_image
from dfvs_service.replay.flight import FlightReplay, Trial
from dfvs_service.replay.recording import Run, StateLog, in_order, read_recording
from dfvs_service.report.flight import RECORDING, Flight, FlightView
from dfvs_service.report.series import SeriesBuilder

_REPEATED = "The flow is computed again, by another build, model or other settings than in flight."
_NO_FLOW = "No flow is drawn: {}."


class RecordedFlight:
    """Flight in the files of one recording."""

    video_rate_hz = 10

    def __init__(self, paths: Sequence[Path]) -> None:
        self._paths = in_order(paths)
        self.name = self._paths[0].stem.removesuffix("-000")
        self.note = ""

    def read(self) -> Flight:
        """Read all but the views.

        Raises
        ------
        RecordingError
            If the files cannot be read, or hold no flight.
        """
        reader = _Reader()
        for entry in read_recording(self._paths, reader.warn):
            if isinstance(entry.message, SessionHeader):
                reader.open(entry.message, entry.payload or b"", entry.run)
            else:
                reader.add(entry.message)
        return reader.flight(self.name, self._paths)

    def views(self) -> Iterator[FlightView]:
        """Every frame that perception looked at, with its flow where perception can run again.

        Raises
        ------
        RecordingError
            As ``read`` does.
        """
        replay: FlightReplay | None = FlightReplay(Trial())
        for entry in read_recording(self._paths, lambda _: None):  # ``read`` passes it on
            message, payload = entry.message, entry.payload or b""
            if isinstance(message, SessionHeader):
                replay = self._opened(replay, message, payload)
                continue
            image = record_image(message, payload)
            if replay is not None:
                replay.record(message, payload)
            if image is not None:
                yield _view(entry.run.seconds(message.t_ns), image, replay)

    def _opened(
        self, replay: FlightReplay | None, header: SessionHeader, image: bytes
    ) -> FlightReplay | None:
        """Go on with a session header's goal, model and settings, or without flow."""
        if replay is None:
            return None
        try:
            replay.open(header, image)
        except DfvsError as error:
            self.note = _NO_FLOW.format(error.problem)
            return None
        self.note = _REPEATED if replay.reasons else ""
        return replay


class _Reader:
    """Takes session headers and frame records, oldest first."""

    def __init__(self) -> None:
        self._headers: list[SessionHeader] = []
        self._runs: list[Run] = []
        self._run_ends_s: list[float] = []
        self._goals: list[tuple[float, ImageArray]] = []
        self._builder = SeriesBuilder(0)
        self._states = StateLog()
        self._warnings: dict[str, None] = {}
        self._is_reached = False
        self._end_s = 0.0

    def open(self, header: SessionHeader, image: bytes, run: Run) -> None:
        if run not in self._runs:
            self._builder.set_start(run.start_ns)
            self._run_ends_s.append(self._end_s)
            self._runs.append(run)
        self._headers.append(header)
        self._goals.append((run.seconds(header.opened_ns), decode_image(image)))

    def warn(self, text: str) -> None:
        self._warnings[f"warning: {text}"] = None

    def add(self, record: FrameRecord) -> None:
        self._end_s = self._runs[-1].seconds(record.t_ns)
        for status in record.heard:
            self._on_status(status)
        self._builder.add_report(record.t_ns, record.report)
        if record.servo:
            self._builder.add_servo(record.servo)

    def _on_status(self, status: GateStatus) -> None:
        self._states.add(status, self._runs[-1])
        self._is_reached = status.reached
        self._warnings |= dict.fromkeys(f"warning: {text}" for text in status.warnings)
        if status.t_ns:
            self._builder.add_setpoint(status.t_ns, status.setpoint)
        vehicle = status.vehicle
        if vehicle is not None:
            self._builder.add_yaw(vehicle.t_ns, vehicle.yaw_rad)
            self._builder.add_position(vehicle.t_ns, vehicle.position_m, vehicle.velocity_m_s)

    def flight(self, name: str, paths: Sequence[Path]) -> Flight:
        first, last = self._headers[0], self._headers[-1]
        states = tuple(self._states.changes)
        summary = FlightSummary(
            name=name,
            folder=str(paths[0].parent),
            vehicle=first.vehicle,
            started=utc_time(self._runs[0].unix_ns),
            duration_s=max(self._end_s, 0.0),
            status="ended",
            exit_code=0 if self._is_reached else None,
            verdict=_verdict(states, self._is_reached),
            states=states,
            told=(*_several(self._runs), *self._warnings),
            version=first.build.get("dfvs", ""),
            size_bytes=sum(path.stat().st_size for path in paths),
        )
        return Flight(
            summary=summary,
            source=RECORDING,
            start_ns=first.opened_ns,
            series=self._builder.series,
            settings=json.dumps(last.settings, indent=1),
            build=json.dumps({"versions": first.build, "model": last.model}, indent=1),
            goals=tuple(self._goals),
            run_ends_s=tuple(self._run_ends_s[1:]),
        )


def _several(runs: Sequence[Run]) -> tuple[str, ...]:
    """Line about a recording of several runs, whose times do not hold the time between them."""
    if len(runs) < 2:
        return ()
    begins = ", ".join(f"{run.from_ns / S:.1f} s ({utc_time(run.unix_ns)})" for run in runs)
    return (f"the recording holds {len(runs)} runs of the service, which begin at {begins}",)


def _verdict(states: Sequence[StateChange], is_reached: bool) -> str:
    """One sentence on how the flight went; ``is_reached`` is the gate's last status about it."""
    if is_reached:
        return "the goal was reached"
    if not states:
        return "the gate was not heard"
    return f"the recording ends in {states[-1].state}: {states[-1].cause}".removesuffix(": ")


def _view(t_s: float, image: ImageArray, replay: FlightReplay | None) -> FlightView:
    processed = None if replay is None else replay.processed
    if processed is None or processed.frame_result is None or not processed.report.healthy:
        return FlightView(t_s, image)
    height, width = image.shape[:2]
    return FlightView(t_s, image, flow_at_size(processed.frame_result.flow, (height, width)))
