"""Keeps the count of perception's turns, and writes down what each of them followed from."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from dfvs_core.messages.frame_record import FrameInput, FrameRecord, SessionHeader
from dfvs_core.messages.link import GateStatus, PerceptionReport
from dfvs_service.perception.frame_processor import Glance, RawSample


class TurnBook:
    """Numbers turns from 0, without gaps, and remembers which opening holds."""

    def __init__(self) -> None:
        self.next_turn = 0
        self._opening = 0

    def open(self, opening: SessionHeader) -> None:
        """Take the opening that holds for the turns to come."""
        self._opening = opening.opened_ns

    def silent(
        self, now_ns: int, heard: Sequence[GateStatus], report: PerceptionReport
    ) -> FrameRecord:
        """Turn for which no sample came."""
        return FrameRecord(self._count(), self._opening, now_ns, tuple(heard), report)

    def looked(
        self,
        sample: RawSample,
        heard: Sequence[GateStatus],
        glance: Glance,
        servo: Mapping[str, Any],
    ) -> FrameRecord:
        """Turn that looked at a sample."""
        outcome = glance.outcome
        sight = FrameInput(
            attachment=sample.attachment.hex(),
            t_arrival_ns=sample.t_arrival_ns,
            t_look_ns=glance.t_look_ns,
            t_servo_ns=None if outcome is None else outcome.now_ns,
            stages_ns=dict(glance.stages_ns or {}),
        )
        number, t_ns = self._count(), glance.t_look_ns
        return FrameRecord(
            number, self._opening, t_ns, tuple(heard), glance.report, sight, dict(servo)
        )

    def _count(self) -> int:
        number, self.next_turn = self.next_turn, self.next_turn + 1
        return number
