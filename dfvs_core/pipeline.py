"""Perception of one goal, frame after frame: match, earlier match, servo step, report.

Owns what is remembered between frames and nothing else: no thread, no file, no network. The
service runs it on live frames; the simulator and the tests run it on rendered ones.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from dfvs_core.arrays import FloatArray
from dfvs_core.correspondence import FlowField
from dfvs_core.depth.keyframes import choose_earlier
from dfvs_core.goal import Goal
from dfvs_core.matching.matcher import Matcher, Prepared
from dfvs_core.servo.exchange import (
    Attitude,
    EarlierMatch,
    ServoInputs,
    ServoResult,
    ServoState,
    Verdict,
)
from dfvs_core.servo.step import servo_step
from dfvs_core.servo.task import ServoTask
from dfvs_core.vehicle_history import Motion
from dfvs_core.wire.frame import Frame
from dfvs_core.wire.link import PerceptionReport

KEPT_FRAMES = 24
UNKNOWN_ERROR = 1e6
"""Stands for an error that could not be estimated: the wire carries finite numbers only."""


@dataclass(frozen=True, slots=True)
class KeptFrame:
    """An earlier frame, ready to be matched, and where its camera was."""

    prepared: Prepared
    T_world_camera: FloatArray


@dataclass(frozen=True, slots=True)
class FrameOutcome:
    """What one frame gave.

    ``stages_ns`` holds the time each stage took: prepare, match, depth_match, servo.
    """

    report: PerceptionReport
    result: ServoResult
    flow: FlowField
    stages_ns: dict[str, int]


class Pipeline:
    """Turns frames into reports for the gate.

    Parameters
    ----------
    task : ServoTask
        Settings, cameras, goal attitude and mounting.
    matcher : Matcher
        Source of dense correspondences.
    goal : Goal
        Picture to fly to.
    tick : callable
        Monotonic time in ns, for the age of frames and the stages' durations.
    """

    def __init__(
        self, task: ServoTask, matcher: Matcher, goal: Goal, tick: Callable[[], int]
    ) -> None:
        self._task = task
        self._matcher = matcher
        self._goal = matcher.prepare(goal.image)
        self._tick = tick
        self._T_body_camera = np.eye(4) if task.mount is None else task.mount.T_body_camera()
        self._kept: deque[KeptFrame] = deque(maxlen=KEPT_FRAMES)
        self._state = ServoState()
        self._last_flow: FlowField | None = None
        self._depth_m = task.config.constant_depth_m

    def process(self, frame: Frame, motion: Motion, engaged: bool) -> FrameOutcome:
        """Work on one frame.

        Parameters
        ----------
        frame : Frame
            Of the size that the task's camera has.
        motion : Motion
            The vehicle's state when it was captured.
        engaged : bool
            Whether the vehicle follows: progress is only asked for then.
        """
        T_world_camera = motion.T_world_body() @ self._T_body_camera
        marks = [self._tick()]
        prepared = self._matcher.prepare(frame.image)
        marks.append(self._tick())
        flow = self._matcher.match(prepared, self._goal, self._last_flow)
        marks.append(self._tick())
        earlier = self._match_earlier(prepared, T_world_camera)
        marks.append(self._tick())
        inputs = ServoInputs(
            now_ns=marks[-1],
            t_capture_ns=frame.t_capture_ns,
            flow=flow,
            velocity=motion.level_velocity(),
            attitude=Attitude(motion.roll_rad, motion.pitch_rad),
            motion_m=self._camera_motion(T_world_camera),
            earlier=earlier,
            engaged=engaged,
        )
        result, self._state = servo_step(self._task, self._state, inputs)
        marks.append(self._tick())
        self._remember(prepared, T_world_camera, flow, result)
        names = ("prepare", "match", "depth_match", "servo")
        stages = {name: marks[i + 1] - marks[i] for i, name in enumerate(names)}
        return FrameOutcome(make_report(self._task, frame, result), result, flow, stages)

    def _match_earlier(self, prepared: Prepared, T_world_camera: FloatArray) -> EarlierMatch | None:
        """Match with an earlier frame where the depth source asks for one."""
        if self._task.config.depth not in ("motion", "flow") or not self._kept:
            return None
        poses = [kept.T_world_camera for kept in self._kept]
        chosen: int | None = len(poses) - 1
        if self._task.config.depth == "motion":
            chosen = choose_earlier(poses, T_world_camera, self._depth_m)
        if chosen is None:
            return None
        kept = self._kept[chosen]
        T_earlier_current = np.linalg.inv(kept.T_world_camera) @ T_world_camera
        return EarlierMatch(self._matcher.match(prepared, kept.prepared), T_earlier_current)

    def _camera_motion(self, T_world_camera: FloatArray) -> tuple[float, float, float]:
        """Motion since the last frame, in the optical axes of then, m."""
        if not self._kept:
            return 0.0, 0.0, 0.0
        last = self._kept[-1].T_world_camera
        x, y, z = last[:3, :3].T @ (T_world_camera[:3, 3] - last[:3, 3])
        return float(x), float(y), float(z)

    def _remember(
        self, prepared: Prepared, T_world_camera: FloatArray, flow: FlowField, result: ServoResult
    ) -> None:
        self._kept.append(KeptFrame(prepared, T_world_camera))
        good = result.verdict in (Verdict.OK, Verdict.STUCK)
        self._last_flow = flow if good else None
        if result.depth_m > 0:
            self._depth_m = result.depth_m


def make_report(task: ServoTask, frame: Frame, result: ServoResult) -> PerceptionReport:
    """What the gate is told about a frame."""
    ok = result.verdict is Verdict.OK
    forward, right, down, yaw_rate = (float(v) for v in result.velocity)
    return PerceptionReport(
        seq=frame.seq,
        t_capture_ns=frame.t_capture_ns,
        velocity=(forward, right, down, yaw_rate),
        healthy=ok,
        reached=result.reached,
        lost=result.verdict is Verdict.STUCK,
        reason="" if ok else result.verdict.value,
        error_m=_finite(result.error_m),
        error_rad=_finite(result.error_rad),
        overlap=result.overlap,
        feature_error=_finite(result.feature_error_px / task.camera.fx),
    )


def _finite(value: float) -> float:
    return value if math.isfinite(value) else UNKNOWN_ERROR
