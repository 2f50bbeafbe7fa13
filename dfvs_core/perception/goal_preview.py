"""Previews: what an earlier frame says about another goal.

A preview depends on nothing but its arguments, so a replay recomputes it bit for bit.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

from dfvs_core.arrays import FloatArray, ImageArray
from dfvs_core.correspondence import FlowField
from dfvs_core.matching.matcher import Matcher, Prepared
from dfvs_core.perception.goal_tracker import Observation
from dfvs_core.servo.exchange import ServoInputs, ServoResult, ServoState, Status
from dfvs_core.servo.level import real_pose
from dfvs_core.servo.step import servo_step
from dfvs_core.servo.task import ServoTask


@dataclass(frozen=True, slots=True)
class KeptFrame:
    """An earlier frame, ready to be matched, and what a preview of another goal needs of it.

    ``T_world_camera`` (4, 4) is where its camera was, m. ``inputs`` are the servo step's without
    any flow. ``state`` is the memory after the frame, without what concerns the goal.
    """

    prepared: Prepared
    T_world_camera: FloatArray
    inputs: ServoInputs
    state: ServoState

    @property
    def t_capture_ns(self) -> int:
        """When the frame was taken."""
        return self.inputs.t_capture_ns


@dataclass(frozen=True, slots=True)
class GoalView:
    """A goal image (H, W, 3) uint8 RGB at the working size, and the same ready to be matched."""

    image: ImageArray
    prepared: Prepared


@dataclass(frozen=True, slots=True)
class GoalPreview:
    """What a frame says about another goal, and the observation that tracking can begin with."""

    result: ServoResult
    observation: Observation | None


Preview = Callable[[], GoalPreview]
"""A preview that is still to be worked out."""


def preview_goal(matcher: Matcher, task: ServoTask, goal: GoalView, kept: KeptFrame) -> GoalPreview:
    """Match a kept frame with a goal, without a prior; ``task`` is at the working size."""
    flow = matcher.match(kept.prepared, goal.prepared)
    result, state = servo_step(task, kept.state, replace(kept.inputs, flow=flow))
    if result.status is not Status.OK:
        return GoalPreview(result, None)
    return GoalPreview(result, observe(task, state, flow, kept.t_capture_ns, kept.T_world_camera))


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
