"""Perception of one goal, frame after frame: match, earlier match, servo step, report.

Owns what is remembered between frames and nothing else: no thread, no file, no network. The
service runs it on live frames; the simulator and the tests run it on rendered ones.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from dfvs_core.arrays import FloatArray, ImageArray
from dfvs_core.colours import is_swapped
from dfvs_core.correspondence import DepthMap, FlowField
from dfvs_core.depth.keyframes import choose_earlier
from dfvs_core.depth.prediction import predict_flow
from dfvs_core.goal import Goal
from dfvs_core.matching.matcher import Matcher, Prepared
from dfvs_core.poses import invert_pose
from dfvs_core.servo.exchange import (
    Attitude,
    EarlierMatch,
    ServoInputs,
    ServoResult,
    ServoState,
    Verdict,
)
from dfvs_core.servo.step import observe_depth, servo_step
from dfvs_core.servo.task import ServoTask
from dfvs_core.vehicle_history import Motion
from dfvs_core.wire.frame import Frame
from dfvs_core.wire.link import PerceptionReport

KEPT_FRAMES = 24
STAGES = ("prepare", "match", "servo")
DEPTH_PERIOD_NS = 200_000_000
"""Depth changes slowly: it is measured five times a second at most."""

UNKNOWN_ERROR = 1e6
"""Stands for an error that could not be estimated: the wire carries finite numbers only."""


@dataclass(frozen=True, slots=True)
class KeptFrame:
    """An earlier frame, ready to be matched, and where its camera was."""

    t_capture_ns: int
    prepared: Prepared
    T_world_camera: FloatArray


Glimpse = Callable[[], ServoResult]
"""A look that is still to be taken."""


@dataclass(frozen=True, slots=True)
class FrameOutcome:
    """What one frame gave.

    ``stages_ns`` holds the time that each of ``STAGES`` took; ``now_ns`` is the time at which the
    servo step judged the frame's age.
    """

    frame: Frame
    result: ServoResult
    flow: FlowField
    stages_ns: dict[str, int]
    now_ns: int

    @property
    def report(self) -> PerceptionReport:
        """What the gate is told; only of a vehicle's four degrees of freedom."""
        return make_report(self.frame, self.result)


@dataclass(frozen=True, slots=True)
class GoalView:
    """A goal picture (H, W, 3) uint8 RGB, and the same ready to be matched."""

    image: ImageArray
    prepared: Prepared


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
        self._goal = self.prepare(goal)
        self._tick = tick
        self._T_body_camera = np.eye(4) if task.mount is None else task.mount.T_body_camera()
        self._kept: deque[KeptFrame] = deque(maxlen=KEPT_FRAMES)
        self._state = ServoState()
        self._last_flow: FlowField | None = None
        self._depth_m = task.config.constant_depth_m
        self._digested_ns = 0
        self._last_inputs: ServoInputs | None = None

    def prepare(self, goal: Goal) -> GoalView:
        """Compute once what depends on another goal's picture alone."""
        return GoalView(goal.image, self._matcher.prepare(goal.image))

    def aim(self, task: ServoTask, goal: GoalView) -> None:
        """Go on to another goal; what was learnt of depth, and of the way so far, stays.

        Parameters
        ----------
        task : ServoTask
            For that goal: the same camera and mounting.
        goal : GoalView
            Of :meth:`prepare`.
        """
        self._task = task
        self._goal = goal
        self._state = ServoState(depth=self._state.depth, depth_map=self._state.depth_map)
        self._last_flow = None

    def glimpse(self, task: ServoTask, goal: GoalView) -> Glimpse | None:
        """What the last frame says about another goal, to be worked out on any thread.

        None before the first frame. Nothing of it is remembered: the frames to come give the same
        results without it.
        """
        if self._last_inputs is None or not self._kept:
            return None
        matcher, prepared = self._matcher, self._kept[-1].prepared
        inputs = replace(self._last_inputs, earlier=None, engaged=False)
        state = ServoState(depth=self._state.depth, depth_map=self._state.depth_map)

        def work() -> ServoResult:
            flow = matcher.match(prepared, goal.prepared)
            return servo_step(task, state, replace(inputs, flow=flow))[0]

        return work

    def process(
        self, frame: Frame, motion: Motion, engaged: bool, depth: DepthMap | None = None
    ) -> FrameOutcome:
        """Work on one frame.

        Parameters
        ----------
        frame : Frame
            Of the size that the task's camera has.
        motion : Motion
            The vehicle's state when it was captured.
        engaged : bool
            Whether the vehicle follows: progress is only asked for then.
        depth : DepthMap, optional
            Of the frame, where something else measures it (``depth = "given"``).
        """
        T_world_camera = motion.T_world_body() @ self._T_body_camera
        marks = [self._tick()]
        prepared = self._matcher.prepare(frame.image)
        marks.append(self._tick())
        flow = self._matcher.match(prepared, self._goal.prepared, self._last_flow)
        marks.append(self._tick())
        earlier = None
        if self._task.config.depth == "flow" and self._kept:
            earlier = self._compare(prepared, T_world_camera, len(self._kept) - 1)
        inputs = ServoInputs(
            now_ns=self._tick(),
            t_capture_ns=frame.t_capture_ns,
            flow=flow,
            velocity=self._velocity(motion, T_world_camera),
            attitude=Attitude(motion.roll_rad, motion.pitch_rad),
            motion_m=self._camera_motion(T_world_camera),
            earlier=earlier,
            given_depth=depth,
            engaged=engaged,
        )
        self._last_inputs = inputs
        result, self._state = servo_step(self._task, self._state, inputs)
        if result.verdict is Verdict.OK and is_swapped(frame.image, self._goal.image, flow):
            nothing = np.zeros_like(result.velocity)
            verdict = Verdict.WRONG_COLOURS
            result = replace(result, verdict=verdict, velocity=nothing, reached=False)
        marks.append(self._tick())
        self._remember(frame, prepared, T_world_camera, flow, result)
        stages = {name: marks[i + 1] - marks[i] for i, name in enumerate(STAGES)}
        return FrameOutcome(frame, result, flow, stages, inputs.now_ns)

    def digest(self) -> int:
        """Compare the last frame with an earlier one to learn about depth; time taken, ns.

        To be called once a frame's report is on its way. Most calls do nothing: a comparison is
        made a few times a second, and only where the camera has moved far enough.
        """
        start_ns = self._tick()
        if self._task.config.depth != "motion" or not self._kept:
            return 0
        last = self._kept[-1]
        if last.t_capture_ns - self._digested_ns < DEPTH_PERIOD_NS:
            return 0
        poses = [kept.T_world_camera for kept in self._kept]
        chosen = choose_earlier(poses[:-1], last.T_world_camera, self._depth_m)
        if chosen is None:
            return 0
        self._digested_ns = last.t_capture_ns
        match = self._compare(last.prepared, last.T_world_camera, chosen)
        if match is not None:
            self._state = observe_depth(self._task, self._state, match)
        return self._tick() - start_ns

    def _compare(
        self, prepared: Prepared, T_world_camera: FloatArray, index: int
    ) -> EarlierMatch | None:
        """Match a frame with one of those kept, by the flow that depth and motion foretell."""
        kept = self._kept[index]
        T_earlier_current = invert_pose(kept.T_world_camera) @ T_world_camera
        if self._state.depth_map is None:
            return None
        stride, camera = self._task.config.stride_px, self._task.camera
        guess = predict_flow(camera, self._state.depth_map, stride, T_earlier_current)
        flow = self._matcher.track(prepared, kept.prepared, guess)
        return None if flow is None else EarlierMatch(flow, T_earlier_current)

    def _velocity(self, motion: Motion, T_world_camera: FloatArray) -> FloatArray:
        """How the vehicle moves, in the components of the task's basis; (d,) m/s, rad/s."""
        if self._task.mount is not None:
            return motion.level_velocity()
        # A free camera's turning is not in the motion; only its prediction would need it.
        return np.append(T_world_camera[:3, :3].T @ motion.velocity_m_s, np.zeros(3))

    def _camera_motion(self, T_world_camera: FloatArray) -> tuple[float, float, float]:
        """Motion since the last frame, in the optical axes of then, m."""
        if not self._kept:
            return 0.0, 0.0, 0.0
        last = self._kept[-1].T_world_camera
        x, y, z = last[:3, :3].T @ (T_world_camera[:3, 3] - last[:3, 3])
        return float(x), float(y), float(z)

    def _remember(
        self,
        frame: Frame,
        prepared: Prepared,
        T_world_camera: FloatArray,
        flow: FlowField,
        result: ServoResult,
    ) -> None:
        self._kept.append(KeptFrame(frame.t_capture_ns, prepared, T_world_camera))
        good = result.verdict in (Verdict.OK, Verdict.STUCK)
        self._last_flow = flow if good else None
        if result.depth_m > 0:
            self._depth_m = result.depth_m


def make_report(frame: Frame, result: ServoResult) -> PerceptionReport:
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
        feature_error=_finite(result.scale_free_error),
    )


def _finite(value: float) -> float:
    return value if math.isfinite(value) else UNKNOWN_ERROR
