"""Replay of perception on recorded frame records.

Nothing in perception depends on when it runs but the two times by which a frame's age is judged.
They are part of every frame record, so the same code, model and settings give the same reports.
"""

import contextlib
import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from dfvs_core.depth.network import DepthEstimator
from dfvs_core.errors import DfvsError
from dfvs_core.geometry.arrays import ImageArray
from dfvs_core.matching.correspondence import FlowField
from dfvs_core.matching.matcher import ImageFeatures, Matcher
from dfvs_core.messages.frame_record import FrameInput, FrameRecord, SessionHeader
from dfvs_core.messages.goal import Goal, GoalSidecar
from dfvs_core.messages.image import decode_image
from dfvs_core.messages.link import PerceptionReport
from dfvs_core.messages.schema import parse, with_present_names
from dfvs_service.frames import RawSample
from dfvs_service.perception.assembly import Clocks, build_frame_processor, servo_task
from dfvs_service.perception.frame_processor import ProcessedFrame
from dfvs_service.record.reading import RecordingError
from dfvs_service.settings.config import ServiceConfig


@dataclass(frozen=True, slots=True)
class Rerun:
    """One frame, as it was in flight and as it is now.

    ``match_ns`` and ``look_ns`` say how long matching and all of the look took now;
    ``FrameInput.stages_ns`` says so for then.
    """

    record: FrameRecord
    report: PerceptionReport
    match_ns: int
    look_ns: int

    @property
    def is_identical(self) -> bool:
        """Whether the report to the gate is the very same."""
        return self.report == self.record.report


@dataclass(slots=True)
class _Clock:
    now_ns: int = 0

    def __call__(self) -> int:
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


class Rerunner:
    """Runs perception on the frame records that follow a session header.

    Parameters
    ----------
    header : SessionHeader
    image : bytes
        The goal, PNG.
    config : ServiceConfig
        The recorded one, or what is to be tried in its place.
    matcher : Matcher
        Likewise.
    depth : DepthEstimator or None
        Depth network of these settings, if they ask for one.
    """

    def __init__(
        self,
        header: SessionHeader,
        image: bytes,
        config: ServiceConfig,
        matcher: Matcher,
        depth: DepthEstimator | None,
    ) -> None:
        goal = recorded_goal(header, image)
        self._look, self._servo = _Clock(), _Clock()
        clocks = Clocks(bytes.fromhex(header.clock), self._look, self._servo)
        self._timed = TimedMatcher(matcher)
        self._frame_processor = build_frame_processor(config, goal, self._timed, clocks, depth)
        self.processed: ProcessedFrame | None = None
        """What became of the newest sample."""

    def set_goal(self, header: SessionHeader, image: bytes, config: ServiceConfig) -> None:
        """Go on to the goal of a session header that follows in the same flight."""
        goal = recorded_goal(header, image)
        pipeline = self._frame_processor.pipeline
        task, view = servo_task(config, goal), pipeline.prepare(goal)
        preview = None
        if header.observed_ns is not None:
            preview = pipeline.evaluate_next_goal(task, view, header.observed_ns)
        pipeline.set_goal(task, view, None if preview is None else preview().observation)

    def record(self, record: FrameRecord, payload: bytes) -> Rerun | None:
        """Run one frame record again; None for one that saw nothing."""
        for status in record.heard:
            self._frame_processor.on_gate_status(status)
        if record.sight is None:
            return None
        sample = self._set_back(record.sight, payload)
        self._timed.spent_ns, start_ns = 0, time.monotonic_ns()
        processed = self._frame_processor.process(sample)
        look_ns, match_ns = time.monotonic_ns() - start_ns, self._timed.spent_ns
        self._frame_processor.pipeline.work_between_frames()
        self.processed = processed
        return Rerun(record, processed.report, match_ns, look_ns)

    def _set_back(self, sight: FrameInput, payload: bytes) -> RawSample:
        """Put the clocks to the times of then."""
        self._look.now_ns = sight.t_look_ns
        self._servo.now_ns = sight.t_look_ns if sight.t_servo_ns is None else sight.t_servo_ns
        return RawSample(payload, bytes.fromhex(sight.attachment), sight.t_arrival_ns)
