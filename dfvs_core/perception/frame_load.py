"""How far the processing of frames keeps up with them."""

from dataclasses import dataclass

PATIENCE_NS = 2_000_000_000
"""So long what is done between frames waits for them to be on time again.

The gate goes on after a second of good data: a vehicle that is held for a late report must get it.
"""
LATE_NS = 200_000_000
"""Age from which on a report is too late for the gate."""
OLD_NS = 250_000_000
"""Age from which on the last reported frame is too old for it."""


@dataclass(slots=True)
class FrameLoad:
    """Times of the last frames, ns.

    ``captured_ns`` is the capture time of the last frame and ``period_ns`` that since the one
    before. ``transport_ns`` is from its capture to its arrival, ``processing_ns`` from there to its
    servo step, which was at ``servo_ns``. ``worked_ns`` is the capture time of the last frame after
    which something was done between frames, and ``step_ns`` is from its servo step to the next.
    """

    captured_ns: int = 0
    period_ns: int = 0
    transport_ns: int = 0
    processing_ns: int = 0
    servo_ns: int = 0
    worked_ns: int = 0
    step_ns: int | None = None

    def take(self, captured_ns: int, arrived_ns: int, servo_ns: int) -> None:
        """Take in a frame at its servo step."""
        if self.captured_ns:
            self.period_ns = captured_ns - self.captured_ns
            if self.worked_ns == self.captured_ns:
                self.step_ns = servo_ns - self.servo_ns
        self.transport_ns = arrived_ns - captured_ns
        self.processing_ns = servo_ns - arrived_ns
        self.captured_ns, self.servo_ns = captured_ns, servo_ns

    def work(self) -> None:
        """Note that something is done after the last frame."""
        self.worked_ns = self.captured_ns

    def is_high(self) -> bool:
        """Whether frames are late: their processing does not keep up, or takes too long.

        That counts from a frame's arrival: transport delays no other frame. What is done between
        frames is taken to last as long as the last time, at first as long as a frame. The next
        frame may have to wait for it, but not longer than until another one arrives. Its report
        must not be too late, nor the last one too old until then.
        """
        if self.captured_ns - self.worked_ns >= PATIENCE_NS or self.period_ns == 0:
            return False
        age_ns = self.transport_ns + self.processing_ns
        step_ns = 2 * self.processing_ns if self.step_ns is None else self.step_ns
        wait_ns = min(max(step_ns - self.period_ns, 0), self.period_ns)
        is_late = age_ns + wait_ns >= LATE_NS or age_ns + step_ns >= OLD_NS
        return is_late or self.processing_ns >= self.period_ns
