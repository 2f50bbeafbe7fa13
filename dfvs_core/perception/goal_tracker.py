"""Goal tracking: correspondences with the goal image in each frame.

1. TRACKING: the flow of the last observation is tracked; where that does not hold, the flow that
   its pose and the depth predict.
2. COASTING: one frame was not tracked. It comes without confidence, as noise passes.
3. LOST: the next one was not either. It is relocalised.
4. SEARCHING: relocalisation has failed; every frame is tracked and relocalised.

A track from which the servo gets nothing in three frames in a row is relocalised in the next one.

Between frames, more is looked for of a goal that is tracked in a part of the image.
"""

from dataclasses import dataclass, field, replace
from enum import StrEnum

from dfvs_core.depth.depth_map import DepthMap
from dfvs_core.depth.prediction import predict_flow
from dfvs_core.geometry.arrays import FloatArray
from dfvs_core.geometry.poses import invert_pose, pose_error
from dfvs_core.matching.correspondence import FlowField, confident_ratio, empty_flow
from dfvs_core.matching.matcher import ImageFeatures, Matcher
from dfvs_core.servo.task import ServoTask

COAST_NS = 150_000_000
"""Longest time since the last observation after which a frame is not relocalised."""

TRACKED_NS = 5_000_000_000
"""Longest time for which the last observation is tracked."""

_MOST_REFUSED = 3
"""Frames in a row that are tracked without an observation, after which one is relocalised."""

_SETTLED_RATIO = 0.45
"""Confident share of the image from which on no more of the goal is looked for."""

_EXTENSION_PERIOD_NS = 1_000_000_000
"""Time between two times that more of it is looked for."""

_EXTENSION_AGE_NS = 2 * COAST_NS
"""Time in which it has to be found, for the next frame to be tracked from there."""

_SAME_M, _SAME_RAD = 0.3, 0.2
"""Distance within which two false goals count as one."""
_TIMES = 2
"""Rejections after which a false goal is excluded: somebody may hide the true goal once."""
_REMEMBERED_NS = 30_000_000_000
"""Time after which a rejection expires: odometry drifts."""


class TrackingState(StrEnum):
    """What the goal tracker does with the next frame."""

    TRACKING = "tracking"
    COASTING = "coasting"
    LOST = "lost"
    SEARCHING = "searching"


@dataclass(frozen=True, slots=True)
class Observation:
    """A frame in which the goal was seen.

    ``T_goal_current`` (4, 4) is the camera's estimated pose in the goal's camera, and
    ``T_world_camera`` (4, 4) where the vehicle's odometry had it, m.
    """

    t_capture_ns: int
    flow: FlowField
    T_goal_current: FloatArray
    T_world_camera: FloatArray


@dataclass(slots=True)
class _FalseGoal:
    T_world_goal: FloatArray
    t_ns: int
    times: int = 1


@dataclass(slots=True)
class _RejectedGoals:
    """False goals, such as repeated structures, that relocalisation would find again."""

    _goals: list[_FalseGoal] = field(default_factory=list)

    def add(self, T_world_goal: FloatArray, t_ns: int) -> None:
        """Add a rejection: the goal camera's pose (4, 4) by odometry, m, and the time."""
        self._goals = [goal for goal in self._goals if t_ns - goal.t_ns <= _REMEMBERED_NS]
        for known in self._goals:
            distance_m, angle_rad = pose_error(known.T_world_goal, T_world_goal)
            if distance_m < _SAME_M and angle_rad < _SAME_RAD:
                known.T_world_goal, known.t_ns, known.times = T_world_goal, t_ns, known.times + 1
                return
        self._goals.append(_FalseGoal(T_world_goal, t_ns))

    def excluded(self, t_ns: int) -> list[FloatArray]:
        """Pose ``T_world_goal`` (4, 4), m, of each that is excluded at a time."""
        recent = [goal for goal in self._goals if t_ns - goal.t_ns <= _REMEMBERED_NS]
        return [goal.T_world_goal for goal in recent if goal.times >= _TIMES]


class GoalTracker:
    """Matches frames with one goal, and keeps the last observation of it.

    Parameters
    ----------
    matcher : Matcher
        Source of dense correspondences.
    goal : ImageFeatures
        The goal image.
    task : ServoTask
        Cameras at the working size, and the grid of the depth maps.
    """

    def __init__(self, matcher: Matcher, goal: ImageFeatures, task: ServoTask) -> None:
        self._matcher, self._goal, self._task = matcher, goal, task
        self._last: Observation | None = None
        self.state = TrackingState.SEARCHING
        """State after the last frame."""
        self._rejected = _RejectedGoals()
        self._has_excluded = False
        """Whether the last relocalisation excluded rejected goals, and nothing was found since."""
        self._refused = 0
        """Frames in a row that were tracked and gave no observation."""
        self._extending: tuple[ImageFeatures, Observation] | None = None
        """Frame in which more of the goal is being looked for, and what is seen of it."""
        self.extended_ns = 0
        """Capture time of the last such frame, or of one that was relocalised since."""

    def update(self, observation: Observation | None) -> None:
        """Keep the observation of the frame that was matched last; None where it gave none."""
        if observation is not None:
            self._last, self.state = observation, TrackingState.TRACKING
            self._has_excluded, self._refused = False, 0

    def reject(self, was_flown_to: bool) -> None:
        """Begin anew: what was tracked is not the goal."""
        last = self._last
        if last is not None and was_flown_to:
            T_world_goal = last.T_world_camera @ invert_pose(last.T_goal_current)
            self._rejected.add(T_world_goal, last.t_capture_ns)
        self._last, self.state, self._extending = None, TrackingState.SEARCHING, None

    def match(
        self,
        image: ImageFeatures,
        t_capture_ns: int,
        T_world_camera: FloatArray,
        depth: DepthMap | None,
    ) -> FlowField:
        """Flow from a frame to the goal.

        Parameters
        ----------
        image : ImageFeatures
            The frame.
        t_capture_ns : int
            When it was taken.
        T_world_camera : (4, 4)
            Where, by the vehicle's odometry, m.
        depth : DepthMap, optional
            Of the frame before, on the grid.
        """
        flow = self._track(image, t_capture_ns, T_world_camera, depth)
        if flow is not None and self._refused < _MOST_REFUSED:
            self._refused += 1
            if self.state is TrackingState.COASTING:
                self.state = TrackingState.TRACKING
            return flow
        self._refused = 0
        if flow is None and self.state is TrackingState.TRACKING:
            self.state = TrackingState.COASTING
            if self._last is not None and t_capture_ns - self._last.t_capture_ns <= COAST_NS:
                return empty_flow(image.size)
        was_coasting = self.state is TrackingState.COASTING
        self.state = TrackingState.LOST if was_coasting else TrackingState.SEARCHING
        return self._relocalise(image, t_capture_ns, T_world_camera, depth)

    def _relocalise(
        self,
        image: ImageFeatures,
        t_capture_ns: int,
        T_world_camera: FloatArray,
        depth: DepthMap | None,
    ) -> FlowField:
        """Flow without a prior; every other one without goals that were rejected."""
        self.extended_ns = t_capture_ns
        excluded: list[FlowField] = []
        if depth is not None and not self._has_excluded:
            excluded = [
                self._predict(invert_pose(T_world_goal) @ T_world_camera, depth)
                for T_world_goal in self._rejected.excluded(t_capture_ns)
            ]
        self._has_excluded = bool(excluded)
        return self._matcher.match(image, self._goal, excluded=excluded)

    def _track(
        self,
        image: ImageFeatures,
        t_capture_ns: int,
        T_world_camera: FloatArray,
        depth: DepthMap | None,
    ) -> FlowField | None:
        """Flow from the last observation, or None."""
        last = self._last
        if last is None or t_capture_ns - last.t_capture_ns > TRACKED_NS:
            return None
        flow = self._matcher.track(image, self._goal, last.flow)
        if flow is None and depth is not None:
            T_last_current = invert_pose(last.T_world_camera) @ T_world_camera
            predicted = self._predict(last.T_goal_current @ T_last_current, depth)
            flow = self._matcher.track(image, self._goal, predicted)
        return flow

    @property
    def is_extending(self) -> bool:
        """Whether a step of :meth:`extend` is still to be done."""
        return self._extending is not None

    def extend(self, image: ImageFeatures, t_capture_ns: int) -> bool:
        """A step of looking for more of the goal than is tracked; whether there was one to do.

        It begins in the frame matched last, where that shows the goal in a small part, a second
        or more after the last time. The step after it ends it: the next frame is tracked from
        what was found, if more of the image is confident.
        """
        last = self._last
        if last is None:
            return False
        if self._extending is not None:
            (begun, seen), self._extending = self._extending, None
            flow = self._matcher.extend(begun, self._goal, seen.flow)
            begun.release()
            is_recent = last.t_capture_ns - seen.t_capture_ns <= _EXTENSION_AGE_NS
            if (
                is_recent
                and flow is not None
                and confident_ratio(flow) > confident_ratio(last.flow)
            ):
                self._last = replace(seen, flow=flow)
            return True
        is_due = t_capture_ns - self.extended_ns >= _EXTENSION_PERIOD_NS
        if not is_due or last.t_capture_ns != t_capture_ns:
            return False
        if confident_ratio(last.flow) >= _SETTLED_RATIO:
            return False
        image.prepare()
        self.extended_ns, self._extending = t_capture_ns, (image, last)
        return True

    def release(self, image: ImageFeatures) -> None:
        """Release what only sparse matches ask of an earlier frame, unless it is being extended."""
        if self._extending is None or self._extending[0] is not image:
            image.release()

    def _predict(self, T_goal_current: FloatArray, depth: DepthMap) -> FlowField:
        """Flow that a pose in the goal's camera and the depth of the grid predict."""
        task, stride_px = self._task, self._task.config.stride_px
        return predict_flow(task.camera, depth, stride_px, T_goal_current, task.goal.camera)
