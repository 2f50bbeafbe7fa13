"""How far the processing of frames keeps up with them, and what work between them does to it."""

from dataclasses import dataclass

PATIENCE_NS = 2_000_000_000
"""So long work that makes a frame late waits since the last one that did.

The gate goes on after a second of good data: a vehicle that is held for a late report must get it.
"""
OLD_NS = 225_000_000
"""Age of the last reported frame at the next servo step from which on it is too old for the gate:
that is at 250 ms, and the report takes time."""

_KEPT_AGES = 2


@dataclass(slots=True)
class Work:
    """A kind of work between frames.

    ``ages_ns`` are how old the frame before was at the servo step after it, the last times that it
    was done. The largest counts: work may have a long and a short step.
    """

    ages_ns: tuple[int, ...] = ()


@dataclass(slots=True)
class FrameLoad:
    """Times of the last frames, ns.

    ``captured_ns`` is the capture time of the last frame and ``period_ns`` that since the one
    before. ``age_ns`` is from its capture to its servo step, ``processing_ns`` the part of it after
    its arrival. ``done`` is the work that was done after it. ``late_ns`` is the capture time of the
    last frame after which work was done that makes frames late.
    """

    captured_ns: int = 0
    period_ns: int = 0
    age_ns: int = 0
    processing_ns: int = 0
    done: Work | None = None
    late_ns: int = 0

    def take(self, captured_ns: int, arrived_ns: int, servo_ns: int) -> None:
        """Take in a frame at its servo step."""
        if self.done is not None:
            age_ns = servo_ns - self.captured_ns
            self.done.ages_ns = (*self.done.ages_ns, age_ns)[-_KEPT_AGES:]
            if age_ns >= OLD_NS:
                self.late_ns = self.captured_ns
        if self.captured_ns:
            self.period_ns = captured_ns - self.captured_ns
        self.age_ns, self.processing_ns = servo_ns - captured_ns, servo_ns - arrived_ns
        self.captured_ns, self.done = captured_ns, None

    def note(self, work: Work) -> None:
        """Note that work is done after the last frame."""
        if self._is_too_long(work):
            self.late_ns = self.captured_ns
        self.done = work

    def must_wait(self, work: Work) -> bool:
        """Whether work has to wait: frames are late, or it would make the last one too old.

        Frames are late where processing does not keep up with them. That counts from a frame's
        arrival: transport delays no other frame. Work is taken to last as long as the last times,
        at first as long as a frame.
        """
        is_patient = self.captured_ns - self.late_ns < PATIENCE_NS
        return is_patient and self._is_too_long(work)

    def _is_too_long(self, work: Work) -> bool:
        if self.period_ns == 0:
            return False
        next_age_ns = max(work.ages_ns, default=self.age_ns + 2 * self.processing_ns)
        return self.processing_ns >= self.period_ns or next_age_ns >= OLD_NS
