"""Perception of one goal, frame after frame: match, depth, servo, verify, result.

Owns what is remembered between frames and nothing else: no thread, no file, no network. The
service runs it on live frames; the simulator and the tests run it on rendered ones.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from dataclasses import replace
from functools import partial

import numpy as np

from dfvs_core.arrays import FloatArray, ImageArray
from dfvs_core.colours import is_swapped
from dfvs_core.correspondence import DepthMap, FlowField
from dfvs_core.depth.keyframes import choose_earlier
from dfvs_core.depth.network import DepthEstimator
from dfvs_core.depth.prediction import predict_flow
from dfvs_core.errors import ConfigError
from dfvs_core.goal import Goal
from dfvs_core.matching.matcher import Matcher, Prepared
from dfvs_core.matching.warping import resized
from dfvs_core.perception.frame_result import STAGES, FrameResult, ViewCheck, conclude
from dfvs_core.perception.goal_preview import (
    GoalView,
    KeptFrame,
    Preview,
    make_goal_view,
    observe,
    preview_goal,
)
from dfvs_core.perception.goal_tracker import GoalTracker, Observation
from dfvs_core.perception.goal_verification import GoalVerifier
from dfvs_core.poses import invert_pose, so3_log
from dfvs_core.servo.config import BY_NETWORK
from dfvs_core.servo.exchange import (
    Attitude,
    EarlierMatch,
    ServoInputs,
    ServoResult,
    ServoState,
    Verdict,
)
from dfvs_core.servo.points import without_cells
from dfvs_core.servo.step import servo_step
from dfvs_core.servo.structure import observe_depth
from dfvs_core.servo.task import ServoTask
from dfvs_core.vehicle_history import Motion
from dfvs_core.wire.frame import Frame

KEPT_FRAMES = 24
DEPTH_PERIOD_NS = 200_000_000
"""Depth changes slowly: it is measured five times a second at most."""
DEPTH_PATIENCE_NS = 600_000_000
"""So long depth waits for frames to be on time again."""

_LEARNT = ("motion", "fused")
"""Choices of depth that learn from the camera's motion."""
_NO_FLOW = FlowField(np.zeros((0, 0, 2), np.float32), np.zeros((0, 0), np.float32))
"""Instead of the flow of a kept frame: a field for each would take tens of megabytes."""


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
    depth : DepthEstimator, optional
        For ``depth = "network"`` and ``"fused"``.

    Raises
    ------
    ConfigError
        If one of these is asked for without a depth network.
    """

    def __init__(
        self,
        task: ServoTask,
        matcher: Matcher,
        goal: Goal,
        tick: Callable[[], int],
        depth: DepthEstimator | None = None,
    ) -> None:
        self._matcher = matcher
        self._config = task.config
        self._depth = depth if task.config.depth in BY_NETWORK else None
        if self._depth is None and task.config.depth in BY_NETWORK:
            raise ConfigError(f"servo.depth = {task.config.depth!r} without a depth network")
        self._goal = self.prepare(goal)
        self._task = _aimed(task, self._goal)
        self._tick = tick
        self._T_body_camera = np.eye(4) if task.mount is None else task.mount.T_body_camera()
        self._kept: deque[KeptFrame] = deque(maxlen=KEPT_FRAMES)
        self._state = ServoState()
        self._tracker = self._make_tracker()
        self._verifier = GoalVerifier(task.config.min_likeness)
        self._depth_m = task.config.constant_depth_m
        self._digested_ns = 0
        self._is_depth_new = False
        self._has_flown = False
        self._last_inputs: ServoInputs | None = None
        self._observed_ns: int | None = None

    @property
    def observed_ns(self) -> int | None:
        """Capture time of the frame whose preview tracking of this goal began with, or None."""
        return self._observed_ns

    def prepare(self, goal: Goal) -> GoalView:
        """Compute once what depends on another goal's picture alone."""
        return make_goal_view(self._matcher, self._depth, self._config, goal)

    def aim(self, task: ServoTask, goal: GoalView, observation: Observation | None = None) -> None:
        """Go on to another goal; what was learnt of depth, and of the way so far, stays.

        Parameters
        ----------
        task : ServoTask
            For that goal: the same camera and mounting.
        goal : GoalView
            Of :meth:`prepare`.
        observation : Observation, optional
            Of that goal, from its preview: it is tracked on, so that no search delays a frame. It
            is dropped where its frame is not kept any more, as no replay could recompute it.
        """
        if observation is not None and self._find_kept(observation.t_capture_ns) is None:
            observation = None
        self._observed_ns = None if observation is None else observation.t_capture_ns
        self._task = _aimed(task, goal)
        self._goal = goal
        self._state = self._state.without_goal()
        self._tracker = self._make_tracker()
        self._tracker.update(observation)
        self._verifier = GoalVerifier(task.config.min_likeness)

    def _make_tracker(self) -> GoalTracker:
        task = self._task
        cameras = task.camera, task.goal.camera
        return GoalTracker(self._matcher, self._goal.prepared, *cameras, task.config.stride_px)

    def glimpse(
        self, task: ServoTask, goal: GoalView, t_capture_ns: int | None = None
    ) -> Preview | None:
        """What a frame says about another goal, to be worked out on any thread.

        The result depends on nothing but the arguments and the kept frame, so a replay recomputes
        it bit for bit. Nothing of it is remembered: the frames to come give the same results
        without it.

        Parameters
        ----------
        task : ServoTask
            For that goal.
        goal : GoalView
            Of :meth:`prepare`.
        t_capture_ns : int, optional
            Of the frame; without it the last one.

        Returns
        -------
        Preview or None
            None where no such frame is kept.
        """
        kept = self._find_kept(t_capture_ns)
        if kept is None:
            return None
        return partial(preview_goal, self._matcher, _at_working_size(task, goal), goal, kept)

    def _find_kept(self, t_capture_ns: int | None) -> KeptFrame | None:
        """Kept frame of a capture time, or the last one."""
        if t_capture_ns is None:
            return self._kept[-1] if self._kept else None
        return next((kept for kept in self._kept if kept.t_capture_ns == t_capture_ns), None)

    def process_frame(
        self, frame: Frame, motion: Motion, engaged: bool, depth: DepthMap | None = None
    ) -> FrameResult:
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

        # 1. Bring the image to the working size.
        prepared = self._matcher.prepare(frame.image)
        marks.append(self._tick())

        # 2. Match it with the goal.
        flow = self._tracker.match(
            prepared, frame.t_capture_ns, T_world_camera, self._state.depth_map
        )
        marks.append(self._tick())

        # 3. Match it with an earlier frame, where depth is taken from each of them.
        earlier = None
        if self._task.config.depth == "flow" and self._kept:
            earlier = self._compare(prepared, T_world_camera, len(self._kept) - 1)

        # 4. Servo: level, depth, pose, velocity.
        inputs = ServoInputs(
            now_ns=self._tick(),
            t_capture_ns=frame.t_capture_ns,
            flow=flow,
            velocity=self._velocity(motion, T_world_camera),
            attitude=Attitude(motion.roll_rad, motion.pitch_rad, motion.yaw_rad),
            motion_m=self._camera_motion(T_world_camera),
            earlier=earlier,
            given_depth=None if depth is None else _resized_depth(depth, prepared.size),
            engaged=engaged,
        )
        servo, self._state = servo_step(self._task, self._state, inputs)

        # 5. Verify that the view is the goal's; 6. conclude.
        view = self._verify(servo, resized(frame.image, prepared.size), inputs)
        result = conclude(servo, view)
        marks.append(self._tick())

        self._remember(inputs, prepared, T_world_camera, result)
        stages = {name: marks[i + 1] - marks[i] for i, name in enumerate(STAGES)}
        return FrameResult(frame, result, flow, stages, inputs.now_ns, self._tracker.state)

    def _verify(self, servo: ServoResult, image: ImageArray, inputs: ServoInputs) -> ViewCheck:
        """Check a view (H, W, 3) at the working size; one that the servo refused is not checked."""
        if servo.verdict is not Verdict.OK:
            return ViewCheck.PASSED
        if is_swapped(image, self._goal.image, inputs.flow):
            return ViewCheck.SWAPPED_CHANNELS
        return self._verifier.check(servo, image, inputs.flow, inputs.t_capture_ns)

    def digest(self) -> int:
        """Learn from the last frame what serves those to come; time taken, ns.

        To be called once a frame's report is on its way. Most calls do nothing: a few times a
        second, and only where the camera has moved far enough, it is compared with an earlier one
        to learn about depth; and one after it, where little is sure, once more with the goal.
        Where frames come late, as after such a call, nothing is done for a while.
        """
        start_ns = self._tick()
        if self._task.config.depth not in _LEARNT or not self._kept or self._is_pressed():
            return 0
        tried = self._rematch() if self._is_depth_new else self._learn_depth()
        self._is_depth_new = tried and not self._is_depth_new
        return self._tick() - start_ns if tried else 0

    def _is_pressed(self) -> bool:
        """Whether the next frame waits already: the last took longer than from one to the next."""
        inputs = self._last_inputs
        if inputs is None or len(self._kept) < 2:
            return False
        t_ns = inputs.t_capture_ns
        if t_ns - self._digested_ns >= DEPTH_PATIENCE_NS:
            return False
        return inputs.now_ns - t_ns >= t_ns - self._kept[-2].t_capture_ns

    def _rematch(self) -> bool:
        """Look for more of the goal in the last frame; False where that was not worth a try."""
        prepared, depth = self._kept[-1].prepared, self._state.depth_map
        if depth is None:
            return False
        return self._tracker.rematch(prepared, self._kept[-1].t_capture_ns, depth)

    def _learn_depth(self) -> bool:
        """Compare the last frame with an earlier one; False if too soon, or none is far enough."""
        last = self._kept[-1]
        if last.t_capture_ns - self._digested_ns < DEPTH_PERIOD_NS:
            return False
        poses = [kept.T_world_camera for kept in self._kept]
        chosen = choose_earlier(poses[:-1], last.T_world_camera, self._depth_m)
        if chosen is None:
            return False
        self._digested_ns = last.t_capture_ns
        match = self._compare(last.prepared, last.T_world_camera, chosen)
        if match is not None:
            self._state = observe_depth(self._task, self._state, match)
        return True

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
        R = T_world_camera[:3, :3]
        turning = np.zeros(3)
        if self._kept and (since_ns := motion.t_ns - self._kept[-1].t_capture_ns) > 0:
            turning = so3_log(self._kept[-1].T_world_camera[:3, :3].T @ R) / (since_ns * 1e-9)
        return np.append(R.T @ motion.velocity_m_s, turning)

    def _camera_motion(self, T_world_camera: FloatArray) -> tuple[float, float, float]:
        """Motion since the last frame, in the optical axes of then, m."""
        if not self._kept:
            return 0.0, 0.0, 0.0
        last = self._kept[-1].T_world_camera
        x, y, z = last[:3, :3].T @ (T_world_camera[:3, 3] - last[:3, 3])
        return float(x), float(y), float(z)

    def _remember(
        self,
        inputs: ServoInputs,
        prepared: Prepared,
        T_world_camera: FloatArray,
        result: ServoResult,
    ) -> None:
        self._last_inputs = inputs
        self._has_flown |= inputs.engaged
        observation = None
        if result.verdict in (Verdict.OK, Verdict.STUCK):
            flow, outliers = inputs.flow, self._state.outliers
            if outliers is not None:
                flow = without_cells(flow, outliers, self._task.config.stride_px)
            observation = observe(
                self._task, self._state, flow, inputs.t_capture_ns, T_world_camera
            )
        self._tracker.update(observation)
        if result.verdict is Verdict.MISTAKEN:
            self._tracker.reject(self._has_flown)
            self._state = self._state.without_false_goal()
        if self._kept:
            self._kept[-1].prepared.slim()  # of earlier frames only previews are searched, and few
        previewed = replace(inputs, flow=_NO_FLOW, earlier=None, engaged=False)
        self._kept.append(
            KeptFrame(prepared, T_world_camera, previewed, self._state.without_goal())
        )
        if result.depth_m > 0:
            self._depth_m = result.depth_m


def _aimed(task: ServoTask, goal: GoalView) -> ServoTask:
    """The task at the working size, with the depth of its goal."""
    return replace(_at_working_size(task, goal), goal_depth=goal.depth())


def _at_working_size(task: ServoTask, goal: GoalView) -> ServoTask:
    """The task with both cameras at the size (height, width) of the flow fields."""
    height, width = goal.prepared.size
    cameras = (camera.scaled(width, height) for camera in (task.camera, task.goal.camera))
    camera, goal_camera = cameras
    return replace(task, camera=camera, goal=replace(task.goal, camera=goal_camera))


def _resized_depth(depth: DepthMap, size: tuple[int, int]) -> DepthMap:
    """Depth of an image at ``size`` (height, width), by the nearest pixel."""
    rows, columns = (
        ((np.arange(n) + 0.5) * given / n).astype(np.intp)
        for n, given in zip(size, depth.z_m.shape, strict=True)
    )
    grid = np.ix_(rows, columns)
    return DepthMap(depth.z_m[grid], depth.validity[grid])
