"""Parts of a replay: result of a frame, clock, timed matcher, recorded settings and goal."""

import contextlib
import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from dfvs_core.errors import DfvsError
from dfvs_core.geometry.arrays import ImageArray
from dfvs_core.matching.correspondence import FlowField
from dfvs_core.matching.matcher import ImageFeatures, Matcher
from dfvs_core.messages.frame_record import FrameRecord, SessionHeader
from dfvs_core.messages.goal import Goal, GoalSidecar
from dfvs_core.messages.image import decode_image
from dfvs_core.messages.link import PerceptionReport
from dfvs_core.messages.schema import parse, with_present_names
from dfvs_service.record.reading import RecordingError
from dfvs_service.settings.config import ServiceConfig


@dataclass(frozen=True, slots=True)
class Rerun:
    """One frame, as it was in flight and as it is now.

    ``match_ns`` and ``frame_ns`` say how long matching and the whole frame took now;
    ``FrameInput.stages_ns`` says so for then.
    """

    record: FrameRecord
    report: PerceptionReport
    match_ns: int
    frame_ns: int

    @property
    def is_identical(self) -> bool:
        """Whether the report to the gate is the very same."""
        return self.report == self.record.report


@dataclass(slots=True)
class RecordedClock:
    """Clock that shows the recorded time to which it is set, ns."""

    now_ns: int = 0

    def __call__(self) -> int:
        """Read the clock."""
        return self.now_ns


class TimedMatcher:
    """A matcher that keeps count of how long it takes."""

    def __init__(self, matcher: Matcher) -> None:
        self._matcher = matcher
        self.spent_ns = 0

    def encode(self, image: ImageArray) -> ImageFeatures:
        """See :class:`Matcher`."""
        with self._timed():
            return self._matcher.encode(image)

    def match(
        self, current: ImageFeatures, other: ImageFeatures, *, excluded: Sequence[FlowField] = ()
    ) -> FlowField:
        """See :class:`Matcher`."""
        with self._timed():
            return self._matcher.match(current, other, excluded=excluded)

    def track(
        self, current: ImageFeatures, other: ImageFeatures, predicted: FlowField
    ) -> FlowField | None:
        """See :class:`Matcher`."""
        with self._timed():
            return self._matcher.track(current, other, predicted)

    def extend(
        self, current: ImageFeatures, other: ImageFeatures, known: FlowField
    ) -> FlowField | None:
        """See :class:`Matcher`."""
        with self._timed():
            return self._matcher.extend(current, other, known)

    @contextlib.contextmanager
    def _timed(self) -> Iterator[None]:
        start_ns = time.monotonic_ns()
        yield
        self.spent_ns += time.monotonic_ns() - start_ns


def recorded_settings(header: SessionHeader) -> ServiceConfig:
    """Settings of the flight.

    Raises
    ------
    RecordingError
        If this version does not know them.
    """
    try:
        return parse(ServiceConfig, with_present_names(ServiceConfig, header.settings))
    except DfvsError as error:
        raise RecordingError(
            f"the recorded settings cannot be used: {error}", "a recording of this version"
        ) from error


def recorded_goal(header: SessionHeader, image: bytes) -> Goal:
    """Goal of a session header, from its PNG.

    Raises
    ------
    DfvsError
        If image or sidecar cannot be read.
    """
    return Goal(decode_image(image), parse(GoalSidecar, header.sidecar))
