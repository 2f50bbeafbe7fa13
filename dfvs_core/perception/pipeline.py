"""Perception pipeline of one goal: match, depth, servo, verify, result.

Owns what is remembered between frames and nothing else: no thread, no file, no network. The
service runs it on live frames; the simulator and the tests run it on rendered ones.
"""

from collections.abc import Callable
from dataclasses import replace
from functools import partial

from dfvs_core.depth.depth_map import DepthMap
from dfvs_core.depth.network import DepthEstimator
from dfvs_core.depth.prediction import predict_flow
from dfvs_core.errors import ConfigError
from dfvs_core.geometry.arrays import FloatArray
from dfvs_core.geometry.poses import invert_pose, pose_error
from dfvs_core.matching.correspondence import empty_flow
from dfvs_core.matching.matcher import ImageFeatures, Matcher
from dfvs_core.matching.warping import resized
from dfvs_core.messages.frame import Frame
from dfvs_core.messages.goal import Goal
from dfvs_core.perception.frame_load import FrameLoad, Work
from dfvs_core.perception.frame_result import STAGES, FrameResult
from dfvs_core.perception.goal_preview import (
    GoalView,
    Preview,
    make_goal_view,
    observe,
    preview_goal,
)
from dfvs_core.perception.goal_tracker import GoalTracker, Observation
from dfvs_core.perception.goal_verification import GoalVerifier
from dfvs_core.perception.keyframes import Keyframe, Keyframes
from dfvs_core.perception.odometry import frame_odometry
from dfvs_core.perception.vehicle_history import Motion
from dfvs_core.servo.config import BY_NETWORK
from dfvs_core.servo.exchange import (
    Attitude,
    EarlierMatch,
    ServoInputs,
    ServoResult,
    ServoState,
    Status,
)
from dfvs_core.servo.points import without_cells
from dfvs_core.servo.step import servo_step
from dfvs_core.servo.structure.relative_depth import observe_depth
from dfvs_core.servo.task import ServoTask

DEPTH_PERIOD_NS = 200_000_000
"""Depth changes slowly: it is measured five times a second at most."""

_NO_FLOW = empty_flow((0, 0))
"""Instead of the flow of a keyframe: a field for each would take tens of megabytes."""


class Pipeline:
    """Turns frames into reports for the gate.

    Parameters
    ----------
    task : ServoTask
        Settings, cameras, goal attitude and mounting.
    matcher : Matcher
        Source of dense correspondences.
    goal : Goal
        Image to fly to.
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
        self._task, self._matcher, self._tick = task, matcher, tick
        self._depth = depth if task.config.depth in BY_NETWORK else None
        if self._depth is None and task.config.depth in BY_NETWORK:
            raise ConfigError(f"servo.depth = {task.config.depth!r} without a depth network")
        self._T_body_camera = task.T_body_camera
        self._keyframes = Keyframes()
        self._last: Keyframe | None = None
        self._load = FrameLoad()
        self._comparison, self._extension, self._depth_work = Work(), Work(), Work()
        self._depth_ns = 0
        self._depth_m = task.config.constant_depth_m
        self._least_baseline_m = 0.0
        self._state = ServoState()
        self.observed_ns: int | None = None
        """Capture time of the keyframe whose preview tracking of this goal began with, or None."""
        self.set_goal(task, self.prepare(goal))

    def prepare(self, goal: Goal) -> GoalView:
        """Compute once what depends on another goal's image alone."""
        return make_goal_view(self._matcher, self._depth, self._task.config, goal)

    def set_goal(
        self, task: ServoTask, goal: GoalView, observation: Observation | None = None
    ) -> None:
        """Go on to another goal; what was learnt of depth, and of the way so far, stays.

        Parameters
        ----------
        task, goal : ServoTask, GoalView
            For that goal, of the same camera and mounting, and of :meth:`prepare`.
        observation : Observation, optional
            Of that goal, from its preview: it is tracked on, so that no search delays a frame. It
            is dropped where its keyframe is not kept any more, as no replay could recompute it.
        """
        if observation is not None and self._keyframes.find(observation.t_capture_ns) is None:
            observation = None
        self.observed_ns = None if observation is None else observation.t_capture_ns
        self._task = task = goal.task(task)
        self._has_flown = False
        self._state = self._state.without_goal()
        self._tracker = GoalTracker(self._matcher, goal.features, task)
        self._tracker.update(observation)
        self._verifier = GoalVerifier(goal.image, task.config.min_matched_texture)

    def evaluate_next_goal(
        self, task: ServoTask, goal: GoalView, t_capture_ns: int | None = None
    ) -> Preview | None:
        """Preview of another goal from a keyframe, to be computed on any thread.

        Nothing of it is remembered: the frames to come give the same results without it. None
        where there is no such keyframe.

        Parameters
        ----------
        task, goal : ServoTask, GoalView
            For that goal, and of :meth:`prepare`.
        t_capture_ns : int, optional
            Of the keyframe; without it the newest one.
        """
        frame = self._keyframes.find(t_capture_ns)
        if frame is None:
            return None
        return partial(preview_goal, self._matcher, task, goal, frame)

    def process_frame(
        self,
        frame: Frame,
        motion: Motion,
        engaged: bool,
        depth: DepthMap | None = None,
        *,
        paused: bool = False,
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
        paused : bool
            Whether it is held instead, and may follow again: progress is what it was then.
        """
        t_ns, T_world_camera = frame.t_capture_ns, motion.T_world_body() @ self._T_body_camera
        marks = [self._tick()]

        # 1. Bring the image to the working size.
        features = self._matcher.encode(frame.image)
        marks.append(self._tick())

        # 2. Match it with the goal.
        depth_map = self._state.depth_map
        flow = self._tracker.match(features, t_ns, T_world_camera, depth_map)
        marks.append(self._tick())

        # 3. Match it with the last frame, where depth is taken from each of them.
        last = self._last if self._task.config.depth == "flow" else None
        earlier = self._compare(features, T_world_camera, last)

        # 4. Servo: level, depth, pose, velocity.
        is_level = self._task.mount is not None
        velocity, motion_m = frame_odometry(motion, T_world_camera, self._last, is_level=is_level)
        inputs = ServoInputs(
            now_ns=self._tick(),
            t_capture_ns=t_ns,
            flow=flow,
            velocity=velocity,
            attitude=Attitude(motion.roll_rad, motion.pitch_rad, motion.yaw_rad),
            motion_m=motion_m,
            earlier=earlier,
            given_depth=None if depth is None else depth.resized(features.size),
            engaged=engaged,
            paused=paused,
        )
        servo, self._state = servo_step(self._task, self._state, inputs)

        # 5. Verify that the view is the goal's, and conclude.
        image = resized(frame.image, features.size)
        result = self._verifier.verify(servo, image, flow, t_ns)
        marks.append(self._tick())

        t_arrival_ns = t_ns if frame.t_arrival_ns is None else frame.t_arrival_ns
        self._load.take(t_ns, t_arrival_ns, inputs.now_ns)
        self._remember(inputs, features, T_world_camera, result)
        stages = {name: marks[i + 1] - marks[i] for i, name in enumerate(STAGES)}
        return FrameResult(frame, result, flow, stages, inputs.now_ns, self._tracker.state)

    def work_between_frames(self) -> int:
        """Do what may wait until the last frame's report is on its way; time taken, ns.

        First what goal verification has to compare. Else, in turn: once a second more of the goal
        is looked for; and depth is learnt a few times a second, where the camera has moved far
        enough, from the frame and a keyframe. What makes frames late is put off, but for the second
        step of what was begun: it would be of no use later.
        """
        start_ns, last = self._tick(), self._last
        if last is None:
            return 0
        tracker, verifier = self._tracker, self._verifier
        extend = partial(tracker.extend, last.features, last.t_capture_ns)
        compare = (self._comparison, verifier.compare, verifier.is_comparing)
        extend_goal = (self._extension, extend, tracker.is_extending)
        learn_depth = (self._depth_work, partial(self._learn_depth, last), False)
        is_depth_first = tracker.extended_ns > self._depth_ns and not tracker.is_extending
        in_turn = (learn_depth, extend_goal) if is_depth_first else (extend_goal, learn_depth)
        for work, do, has_begun in (compare, *in_turn):
            if (has_begun or not self._load.must_wait(work)) and do():
                self._load.note(work)
                return self._tick() - start_ns
        return 0

    def _learn_depth(self, last: Keyframe) -> bool:
        """Compare the last frame with a keyframe; False if too soon, or none is far enough.

        Where a baseline tells nothing the scene may be farther away than is believed: the next one
        is twice as long.
        """
        if self._task.config.depth not in ("motion", "fused"):
            return False
        if last.t_capture_ns - self._depth_ns < DEPTH_PERIOD_NS:
            return False
        chosen = self._keyframes.for_depth(
            last.T_world_camera, self._depth_m, self._least_baseline_m
        )
        if chosen is None:
            return False
        self._depth_ns = last.t_capture_ns
        match = self._compare(last.features, last.T_world_camera, chosen)
        if match is not None:
            before, self._state = self._state, observe_depth(self._task, self._state, match)
            baseline_m, _ = pose_error(chosen.T_world_camera, last.T_world_camera)
            self._least_baseline_m = 2.0 * baseline_m if self._state is before else 0.0
        return True

    def _compare(
        self, features: ImageFeatures, T_world_camera: FloatArray, earlier: Keyframe | None
    ) -> EarlierMatch | None:
        """Match a frame with an earlier one, by the flow that depth and motion predict."""
        if earlier is None or self._state.depth_map is None:
            return None
        T_earlier_current = invert_pose(earlier.T_world_camera) @ T_world_camera
        stride, camera = self._task.config.stride_px, self._task.camera
        predicted = predict_flow(camera, self._state.depth_map, stride, T_earlier_current)
        flow = self._matcher.track(features, earlier.features, predicted)
        return None if flow is None else EarlierMatch(flow, T_earlier_current)

    def _remember(
        self,
        inputs: ServoInputs,
        features: ImageFeatures,
        T_world_camera: FloatArray,
        result: ServoResult,
    ) -> None:
        if result.status is Status.NOT_FINITE:  # the servo did not take the frame in either
            self._tracker.update(None)
            return
        t_ns, observation = inputs.t_capture_ns, None
        self._has_flown |= inputs.engaged
        if result.status in (Status.OK, Status.STUCK):
            flow, outliers = inputs.flow, self._state.outliers
            if outliers is not None:
                flow = without_cells(flow, outliers, self._task.config.stride_px)
            observation = observe(self._task, self._state, flow, t_ns, T_world_camera)
        self._tracker.update(observation)
        if result.status is Status.FALSE_GOAL:
            self._tracker.reject(self._has_flown)
            self._state = self._state.without_goal()
        if self._last is not None:
            self._tracker.release(self._last.features)
        if result.depth_m > 0:
            self._depth_m = result.depth_m
        inputs = replace(inputs, flow=_NO_FLOW, earlier=None, engaged=False, paused=False)
        self._last = Keyframe(features, T_world_camera, inputs, self._state.without_goal())
        self._keyframes.add(self._last, self._depth_m)
