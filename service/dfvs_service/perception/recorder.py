"""Keeps the count of perception's turns, and writes down what each of them followed from."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from dfvs_core.messages.frame_record import Opening, Sight, Turn
from dfvs_core.messages.link import GateStatus, PerceptionReport
from dfvs_service.perception.frame_processor import ProcessedFrame, RawSample


class FrameRecorder:
    """Numbers turns from 0, without gaps, and remembers which opening holds."""

    def __init__(self) -> None:
        self.next_record = 0
        self._opening = 0

    def open(self, opening: Opening) -> None:
        """Take the opening that holds for the turns to come."""
        self._opening = opening.opened_ns

    def silent(self, now_ns: int, heard: Sequence[GateStatus], report: PerceptionReport) -> Turn:
        """Turn for which no sample came."""
        return Turn(self._count(), self._opening, now_ns, tuple(heard), report)

    def looked(
        self,
        sample: RawSample,
        heard: Sequence[GateStatus],
        glance: ProcessedFrame,
        servo: Mapping[str, Any],
    ) -> Turn:
        """Turn that looked at a sample."""
        outcome = glance.outcome
        sight = Sight(
            attachment=sample.attachment.hex(),
            t_arrival_ns=sample.t_arrival_ns,
            t_look_ns=glance.t_look_ns,
            t_servo_ns=None if outcome is None else outcome.now_ns,
            stages_ns=dict(glance.stages_ns or {}),
        )
        number, t_ns = self._count(), glance.t_look_ns
        return Turn(number, self._opening, t_ns, tuple(heard), glance.report, sight, dict(servo))

    def _count(self) -> int:
        number, self.next_record = self.next_record, self.next_record + 1
        return number
