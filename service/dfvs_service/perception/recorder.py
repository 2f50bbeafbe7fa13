"""Session headers of a recording, from which a flight can be rerun, and its frame records."""

import time
from collections.abc import Callable, Mapping, Sequence
from typing import Any

from dfvs_core.messages.frame_record import FrameInput, FrameRecord, SessionHeader
from dfvs_core.messages.goal import Goal
from dfvs_core.messages.link import GateStatus, PerceptionReport
from dfvs_core.messages.schema import dump
from dfvs_service.frames import RawSample
from dfvs_service.perception.assembly import perception_files
from dfvs_service.perception.build import build_versions
from dfvs_service.perception.frame_processor import ProcessedFrame
from dfvs_service.settings.config import ServiceConfig


class FrameRecorder:
    """Numbers one process's frame records from 0, without gaps, under its session headers.

    Code and models are hashed once, none of it in flight.

    ``clock`` is the identity of the process's monotonic clock, which ``tick`` reads in ns.

    Raises
    ------
    ModelError
        If the model's files cannot be read.
    """

    def __init__(
        self, config: ServiceConfig, clock: bytes, tick: Callable[[], int] = time.monotonic_ns
    ) -> None:
        self._vehicle, self._clock, self._tick = config.vehicle.name, clock.hex(), tick
        self._unix_offset_ns = time.time_ns() - tick()
        self._settings: dict[str, Any] = dump(config)
        self._build, self._model = build_versions(), perception_files(config)
        self._next_record = 0
        self._header_ns = 0

    def open(self, goal: Goal, observed_ns: int | None = None) -> SessionHeader:
        """Session header, as of now, of the frame records to come on the way to a goal.

        ``observed_ns`` is the pipeline's.
        """
        self._header_ns = self._tick()
        return SessionHeader(
            vehicle=self._vehicle,
            first_turn=self._next_record,
            opened_ns=self._header_ns,
            clock=self._clock,
            unix_offset_ns=self._unix_offset_ns,
            build=self._build,
            model=self._model,
            settings=self._settings,
            sidecar=dump(goal.sidecar),
            observed_ns=observed_ns,
        )

    def without_sample(
        self, now_ns: int, statuses: Sequence[GateStatus], report: PerceptionReport
    ) -> FrameRecord:
        """Frame record for which no sample came."""
        return FrameRecord(self._count(), self._header_ns, now_ns, tuple(statuses), report)

    def with_sample(
        self,
        sample: RawSample,
        statuses: Sequence[GateStatus],
        processed: ProcessedFrame,
        servo: Mapping[str, Any],
    ) -> FrameRecord:
        """Frame record of a sample."""
        frame_result = processed.frame_result
        sight = FrameInput(
            attachment=sample.attachment.hex(),
            t_arrival_ns=sample.t_arrival_ns,
            t_look_ns=processed.t_look_ns,
            t_servo_ns=None if frame_result is None else frame_result.now_ns,
            stages_ns=dict(processed.stages_ns or {}),
        )
        number, t_ns = self._count(), processed.t_look_ns
        return FrameRecord(
            number, self._header_ns, t_ns, tuple(statuses), processed.report, sight, dict(servo)
        )

    def _count(self) -> int:
        number, self._next_record = self._next_record, self._next_record + 1
        return number
