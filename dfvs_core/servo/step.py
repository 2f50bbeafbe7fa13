"""One frame's way from correspondences to a velocity: ``servo_step``, a pure function.

The service, the simulator and the benchmark all call this one.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from dfvs_core.arrays import BoolArray, Float32Array, FloatArray
from dfvs_core.correspondence import DepthMap
from dfvs_core.depth.choice import depth_source
from dfvs_core.depth.source import DepthInputs, DepthState, EarlierView
from dfvs_core.servo.course import Way, course_agreement, follow
from dfvs_core.servo.exchange import (
    EarlierMatch,
    ServoInputs,
    ServoResult,
    ServoState,
    Verdict,
)
from dfvs_core.servo.feature_error import Reference, feature_error
from dfvs_core.servo.law import NormalEquations
from dfvs_core.servo.level import level_points
from dfvs_core.servo.motion import distance_and_angle, find_goal, is_clear, wanted_motion
from dfvs_core.servo.points import GridSamples, ServoPoints, points_from_flow, sample_grid
from dfvs_core.servo.pose import GoalPose
from dfvs_core.servo.stop import (
    ErrorScore,
    StopState,
    error_score,
    is_reached,
    is_stuck,
    update_stop,
)
from dfvs_core.servo.task import ServoTask
from dfvs_core.servo.velocity import AdaptiveGain, saturate, velocity_for
from dfvs_core.servo.weights import weighted_median

_MIN_POINTS = 24
_NOISE_FACTOR = 10.0
_GO_ON = 0.5
"""Factor on the share of the view that must show the goal, once it has been found."""
_DIVIDED = 0.65
"""Weight kept over weight before, below which what a pose rejects is taken for wrong."""
_CLEAR_OVERLAP = 0.15
"""Share of the view that shows the goal from which on the gain is full."""


def servo_step(
    task: ServoTask, state: ServoState, inputs: ServoInputs
) -> tuple[ServoResult, ServoState]:
    """From one frame's correspondences to a velocity (DFVS Eq. (1), corrected).

    Returns
    -------
    ServoResult
        What is expected to go wrong is a verdict in it, never an exception.
    ServoState
        For the next frame.
    """
    if not inputs.flow.is_finite():
        return _refused(task, Verdict.NOT_FINITE, 0.0), state

    # 1. Read the flow on a grid, and give every point a depth.
    samples = sample_grid(inputs.flow, task.config.stride_px)
    depth, depth_state = _estimate_depth(task, state, inputs, samples)
    points = points_from_flow(samples, depth, task.camera, task.goal.camera)

    # 2. Take both views to the gravity-aligned virtual camera.
    points = level_points(task, inputs.attitude, points)
    trusted = points.weight > task.config.min_confidence
    overlap = float(trusted.sum()) / samples.confidence.size
    state = replace(state, depth=depth_state, depth_map=depth, outliers=None)
    least = task.config.min_overlap * (1.0 if state.T_current_goal is None else _GO_ON)
    if overlap < least or trusted.sum() < _MIN_POINTS:
        return _refused(task, Verdict.NO_OVERLAP, overlap), state
    points = points.select(trusted)

    # 3. Find where the goal is, and who is out of line.
    pose = find_goal(task, points, state.T_current_goal)
    before = state.reference if inputs.engaged else None
    spacing = task.config.stride_px / task.camera.fx
    left, reference = feature_error(points, spacing, before)
    way = _follow(state.way if reference is before else None, inputs)
    agreement = _course_agreement(task, reference, points, way)
    points = replace(points, weight=pose.weight)

    # 4. Solve for the motion, and make a velocity of it.
    motion, equations = wanted_motion(task, points, pose)
    velocity = _velocity(task, motion, inputs, overlap)

    # 5. Judge.
    error_m, error_rad = distance_and_angle(task, pose)
    score = ErrorScore(inputs.t_capture_ns, error_score(error_m, error_rad, task.config), left)
    stop = update_stop(state.stop, score, inputs.engaged)
    feature_error_px = _feature_error_px(task, points)
    verdict = _judge(task, pose, equations, feature_error_px, stop)
    flown = verdict is Verdict.OK
    residual_px = pose.residual * task.camera.fx
    speed, asked = (float(np.linalg.norm(v[:3])) for v in (inputs.velocity, velocity))
    result = ServoResult(
        verdict=verdict,
        velocity=velocity if flown else np.zeros_like(velocity),
        motion=motion,
        error_m=error_m,
        error_rad=error_rad,
        feature_error_px=feature_error_px,
        feature_error=left,
        course_agreement=agreement,
        residual_px=residual_px,
        inlier_share=pose.inlier_share,
        overlap=overlap,
        condition=equations.condition,
        depth_m=weighted_median(points.z_m, points.weight),
        reached=flown and residual_px < task.config.tolerance_px and is_reached(stop, speed, asked),
    )
    outliers = _outliers(task, pose, trusted).reshape(samples.confidence.shape)
    return result, ServoState(
        depth_state, depth, pose.T_current_goal, stop, reference, way, outliers
    )


def _outliers(task: ServoTask, pose: GoalPose, trusted: BoolArray) -> BoolArray:
    """Which of the grid's points (N,) contradict a pose that explains those that are trusted.

    No point where they are few: another surface, whose depth is not known yet, may be among them.
    """
    outliers = np.zeros_like(trusted)
    if is_clear(task, pose) and pose.inlier_share < _DIVIDED:
        outliers[trusted] = pose.weight <= 0.0
    return outliers


def _judge(
    task: ServoTask,
    pose: GoalPose,
    equations: NormalEquations,
    feature_error_px: float,
    stop: StopState,
) -> Verdict:
    """Tell whether the frame may be flown, and if not why not."""
    config = task.config
    unexplained = pose.residual * task.camera.fx
    tolerated = max(_NOISE_FACTOR * config.flow_noise_px, config.max_residual * feature_error_px)
    if pose.inlier_share < config.min_inliers or unexplained > tolerated:
        return Verdict.NO_AGREEMENT
    if equations.condition > config.max_condition:
        return Verdict.DEGENERATE
    if is_stuck(stop, config.progress_s):
        return Verdict.STUCK
    return Verdict.OK


def _refused(task: ServoTask, verdict: Verdict, overlap: float) -> ServoResult:
    """Result of a frame that cannot be worked on: zero velocity, unknown error."""
    nothing = np.zeros(task.basis.size)
    unknown = float("inf")
    return ServoResult(
        verdict=verdict,
        velocity=nothing,
        motion=nothing,
        error_m=unknown,
        error_rad=unknown,
        feature_error_px=unknown,
        feature_error=unknown,
        course_agreement=None,
        residual_px=unknown,
        inlier_share=0.0,
        overlap=overlap,
        condition=unknown,
        depth_m=0.0,
        reached=False,
    )


def _follow(way: Way | None, inputs: ServoInputs) -> Way:
    return follow(way, inputs.t_capture_ns, inputs.velocity[:3], inputs.attitude.yaw_rad)


def _course_agreement(
    task: ServoTask, reference: Reference, points: ServoPoints, way: Way
) -> float | None:
    """Of a vehicle; what a free camera says of its motion is no other thing than what it sees."""
    if task.mount is None:
        return None
    return course_agreement(reference.cells, points, task.basis, way)


def _feature_error_px(task: ServoTask, points: ServoPoints) -> float:
    lengths = np.linalg.norm(points.error, axis=1)
    return weighted_median(lengths, points.weight) * task.camera.fx


def observe_depth(task: ServoTask, state: ServoState, match: EarlierMatch) -> ServoState:
    """Learn about depth from the frame of the last ``servo_step`` and an earlier one.

    A comparison costs as much as the match with the goal; done after the velocity was sent, it
    serves the frames to come and delays none.
    """
    samples = sample_grid(match.flow, task.config.stride_px)
    xy = task.camera.normalise(samples.pixels)
    source = depth_source(task.config, task.camera)
    depth = source.observe(xy, _earlier_view(task, match), state.depth)
    return replace(state, depth=depth)


def _estimate_depth(
    task: ServoTask, state: ServoState, inputs: ServoInputs, samples: GridSamples
) -> tuple[DepthMap, DepthState | None]:
    """Depth of the grid points, and the depth source's memory."""
    xy = task.camera.normalise(samples.pixels)
    depth_inputs = DepthInputs(
        xy=xy,
        earlier=None if inputs.earlier is None else _earlier_view(task, inputs.earlier),
        motion_m=inputs.motion_m,
        given=_on_grid(inputs.given_depth, task.config.stride_px),
    )
    return depth_source(task.config, task.camera).estimate(depth_inputs, state.depth)


def _earlier_view(task: ServoTask, match: EarlierMatch) -> EarlierView:
    samples = sample_grid(match.flow, task.config.stride_px)
    xy = task.camera.normalise(samples.pixels + samples.flow)
    return EarlierView(xy, samples.confidence, match.T_earlier_current)


def _on_grid(depth: DepthMap | None, stride: int) -> DepthMap | None:
    if depth is None:
        return None

    def pick(values: Float32Array) -> Float32Array:
        return values[stride // 2 :: stride, stride // 2 :: stride]

    return DepthMap(pick(depth.z_m), pick(depth.validity))


def _velocity(
    task: ServoTask, motion: FloatArray, inputs: ServoInputs, overlap: float
) -> FloatArray:
    """Velocity (d,) within the limits; where little is seen the pose is poor, and the gain low."""
    age_s = max(inputs.now_ns - inputs.t_capture_ns, 0) * 1e-9
    late_s = task.response_s + (age_s if task.mount is not None else 0.0)
    config = task.config
    gain = AdaptiveGain(config.gain_far, config.gain_near, config.gain_error)
    caution = min(1.0, overlap / _CLEAR_OVERLAP)
    return saturate(caution * velocity_for(motion, inputs.velocity, late_s, gain), task.limits)
