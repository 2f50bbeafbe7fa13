"""Processor of raw samples and gate statuses, without sockets or threads."""

from collections.abc import Callable
from dataclasses import dataclass, replace

from dfvs_core.gate.states import GateState
from dfvs_core.geometry.camera import CameraModel
from dfvs_core.messages.frame import Frame
from dfvs_core.messages.link import GateStatus, PerceptionReport
from dfvs_core.perception.frame_result import UNKNOWN_ERROR, FrameResult
from dfvs_core.perception.frame_validator import Expected, GuardState, admit
from dfvs_core.perception.pipeline import Pipeline
from dfvs_core.perception.vehicle_history import VehicleHistory
from dfvs_service.frames import RawSample

UNKNOWN_ATTITUDE = "the vehicle's attitude at capture is not known"
"""Why a good frame is refused."""


@dataclass(frozen=True, slots=True)
class ProcessedFrame:
    """What became of one sample: a report always, frame and result where it was usable.

    ``t_look_ns`` is the time at which the frame's age was judged.
    """

    report: PerceptionReport
    t_look_ns: int
    frame: Frame | None = None
    frame_result: FrameResult | None = None
    stages_ns: dict[str, int] | None = None

    @property
    def is_reported(self) -> bool:
        """Whether the gate is told of it; see :attr:`FrameResult.is_coasting`."""
        return self.frame_result is None or not self.frame_result.is_coasting


class FrameProcessor:
    """Judges samples, keeps the vehicle's history, and runs the pipeline on good frames.

    Every frame must fit ``camera`` and be stamped with the clock of the identity ``clock``;
    ``tick`` reads that clock, monotonic ns.
    """

    def __init__(
        self, camera: CameraModel, pipeline: Pipeline, clock: bytes, tick: Callable[[], int]
    ) -> None:
        self._expected = Expected(camera, clock)
        self.pipeline = pipeline
        self._tick = tick
        self._validator_state = GuardState()
        self._history = VehicleHistory()
        self.servoing = False
        """Whether the vehicle follows, so that the error must fall."""
        self.paused = False
        """Whether that is interrupted: the time in which the error must fall stands still."""
        self.refused = 0

    def on_gate_status(self, status: GateStatus) -> None:
        """Take in the gate's state and the vehicle's."""
        self.servoing = status.state == GateState.SERVO
        self.paused = status.state == GateState.HOLD
        if status.vehicle is not None:
            self._history.add(status.vehicle)

    def process(self, sample: RawSample) -> ProcessedFrame:
        """Work on one sample; whatever is wrong with it becomes the report's reason."""
        t_start = self._tick()
        came = admit(
            self._validator_state, sample.payload, sample.attachment, self._expected, t_start
        )
        self._validator_state, frame = came.state, came.frame
        if frame is None:
            return self._refuse(t_start, came.seq, came.t_capture_ns, came.reason)
        motion = self._history.at(frame.t_capture_ns)
        if motion is None:
            return self._refuse(t_start, frame.seq, frame.t_capture_ns, UNKNOWN_ATTITUDE)
        frame = replace(frame, t_arrival_ns=sample.t_arrival_ns)
        t_decoded = self._tick()
        frame_result = self.pipeline.process_frame(frame, motion, self.servoing, paused=self.paused)
        stages = {
            "transport": sample.t_arrival_ns - frame.t_capture_ns,
            "wait": t_start - sample.t_arrival_ns,
            "decode": t_decoded - t_start,
            **frame_result.stages_ns,
            "capture_to_report": self._tick() - frame.t_capture_ns,
        }
        return ProcessedFrame(frame_result.report, t_start, frame, frame_result, stages)

    def _refuse(self, t_look_ns: int, seq: int, t_capture_ns: int, reason: str) -> ProcessedFrame:
        self.refused += 1
        return ProcessedFrame(unhealthy_report(seq, max(t_capture_ns, 0), reason), t_look_ns)


def unhealthy_report(seq: int, t_capture_ns: int, reason: str) -> PerceptionReport:
    """Report that forbids to fly, with the reason why."""
    return PerceptionReport(
        seq=seq,
        t_capture_ns=t_capture_ns,
        velocity=(0.0, 0.0, 0.0, 0.0),
        healthy=False,
        reached=False,
        lost=False,
        reason=reason[:200],
        error_m=UNKNOWN_ERROR,
        error_rad=UNKNOWN_ERROR,
        overlap=0.0,
    )
