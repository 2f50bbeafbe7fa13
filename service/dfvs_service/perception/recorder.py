"""Numbered frame records of perception's steps."""

from collections.abc import Mapping, Sequence
from typing import Any

from dfvs_core.messages.frame_record import FrameInput, FrameRecord, SessionHeader
from dfvs_core.messages.link import GateStatus, PerceptionReport
from dfvs_service.frames import RawSample
from dfvs_service.perception.frame_processor import ProcessedFrame


class FrameRecorder:
    """Numbers frame records from 0, without gaps, and remembers which session header holds."""

    def __init__(self) -> None:
        self.next_record = 0
        self._header_ns = 0

    def open(self, header: SessionHeader) -> None:
        """Take the session header that holds for the frame records to come."""
        self._header_ns = header.opened_ns

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
        number, self.next_record = self.next_record, self.next_record + 1
        return number
