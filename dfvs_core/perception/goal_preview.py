"""Previews of another goal from a keyframe.

A preview depends on nothing but its arguments, so a replay recomputes it bit for bit.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cache

from dfvs_core.depth.network import DepthEstimator, GoalDepth, goal_depth
from dfvs_core.geometry.arrays import FloatArray
from dfvs_core.matching.config import MatchingConfig
from dfvs_core.matching.correspondence import FlowField
from dfvs_core.matching.elsewhere import SiftImage
from dfvs_core.matching.matcher import ImageFeatures, Matcher
from dfvs_core.matching.warping import resized
from dfvs_core.messages.goal import Goal
from dfvs_core.perception.goal_tracker import Observation
from dfvs_core.perception.keyframes import Keyframe
from dfvs_core.servo.config import ServoConfig
from dfvs_core.servo.exchange import ServoResult, ServoState, Status
from dfvs_core.servo.level import real_pose
from dfvs_core.servo.step import servo_step
from dfvs_core.servo.task import ServoTask


@dataclass(frozen=True, slots=True)
class GoalView:
    """A goal image at the working size, and the same ready to be matched.

    ``depth`` gives its depth by a network, None without one; it is estimated when first asked for.
    """

    image: SiftImage
    features: ImageFeatures
    depth: Callable[[], GoalDepth | None]

    def task(self, task: ServoTask) -> ServoTask:
        """A task with both cameras at the working size, and the depth of this goal.

        The keypoints that verification needs are found here too: a preview asks for its task on
        a thread of its own, and no frame at the goal has to wait for them.
        """
        if task.config.min_matched_texture > 0.0:
            self.image.prepare()
        height, width = self.features.size
        camera, goal_camera = (c.scaled(width, height) for c in (task.camera, task.goal.camera))
        goal = replace(task.goal, camera=goal_camera)
        return replace(task, camera=camera, goal=goal, goal_depth=self.depth())


def make_goal_view(
    matcher: Matcher, network: DepthEstimator | None, config: ServoConfig, goal: Goal
) -> GoalView:
    """Compute what depends on a goal alone; its depth, where there is a network, at first need."""
    features = matcher.encode(goal.image)
    image = resized(goal.image, features.size)

    def depth() -> GoalDepth | None:
        if network is None:
            return None
        camera = goal.sidecar.camera.scaled(image.shape[1], image.shape[0])
        found = network.estimate(image, camera)
        return goal_depth(found, config.stride_px, config.constant_depth_m)

    return GoalView(SiftImage(image, MatchingConfig()), features, cache(depth))


@dataclass(frozen=True, slots=True)
class GoalPreview:
    """Result of a keyframe for another goal, and the observation that tracking begins with."""

    result: ServoResult
    observation: Observation | None


Preview = Callable[[], GoalPreview]
"""A preview that is still to be worked out."""


def preview_goal(matcher: Matcher, task: ServoTask, goal: GoalView, frame: Keyframe) -> GoalPreview:
    """Match a keyframe with a goal, without a prior."""
    task = goal.task(task)
    flow = matcher.match(frame.features, goal.features)
    frame.features.release()
    result, state = servo_step(task, frame.state, replace(frame.inputs, flow=flow))
    if result.status is not Status.OK:
        return GoalPreview(result, None)
    return GoalPreview(result, observe(task, state, flow, frame.t_capture_ns, frame.T_world_camera))


def observe(
    task: ServoTask,
    state: ServoState,
    flow: FlowField,
    t_capture_ns: int,
    T_world_camera: FloatArray,
) -> Observation | None:
    """Observation of the goal by the servo state after a frame; None where there is no pose."""
    if state.T_current_goal is None or state.last is None:
        return None
    T_goal_current = real_pose(task, state.last.attitude, state.T_current_goal)
    return Observation(t_capture_ns, flow, T_goal_current, T_world_camera)
