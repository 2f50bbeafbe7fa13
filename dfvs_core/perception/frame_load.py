"""How far the processing of frames keeps up with them."""

from dataclasses import dataclass

from dfvs_core.perception.keyframes import Keyframe

PATIENCE_NS = 600_000_000
"""So long what is done between frames waits for them to be on time again."""
LATE_NS = 200_000_000
"""Age from which on a report is too late for the gate."""


@dataclass(slots=True)
class FrameLoad:
    """Times of the last frames, ns.

    ``period_ns`` lies between the last two, ``processing_ns`` between a frame's arrival and its
    servo step; ``worked_ns`` is the last frame after which something was done between frames.
    """

    period_ns: int = 0
    processing_ns: int = 0
    worked_ns: int = 0

    def is_high(self, last: Keyframe) -> bool:
        """Whether frames are late: their processing does not keep up, or takes too long.

        It counts from a frame's arrival: transport delays no other frame. What is done between
        frames takes as long as a frame, and the next report is so much older.
        """
        t_ns = last.t_capture_ns
        if t_ns - self.worked_ns >= PATIENCE_NS or self.period_ns == 0:
            return False
        next_age_ns = last.inputs.now_ns - t_ns + self.processing_ns
        return self.processing_ns >= self.period_ns or next_age_ns >= LATE_NS
