"""``servo_step``: pure function from correspondences to a velocity.

The service, the simulator and the benchmark all call this one.
"""

from dataclasses import replace

import numpy as np

from dfvs_core.geometry.arrays import BoolArray, FloatArray
from dfvs_core.geometry.poses import make_pose, rotation_from_euler
from dfvs_core.geometry.robust_weights import weighted_median
from dfvs_core.servo.checks.motion_monitor import FrameMotion, MotionMeasures, velocity_error
from dfvs_core.servo.checks.mounting import probing_velocity
from dfvs_core.servo.exchange import (
    LastFrame,
    ServoInputs,
    ServoResult,
    ServoState,
    Status,
    Uncertainty,
)
from dfvs_core.servo.goal_filter import GoalEstimate
from dfvs_core.servo.law import NormalEquations
from dfvs_core.servo.level import attitude_error, level_points
from dfvs_core.servo.motion import find_goal, is_clear, wanted_motion
from dfvs_core.servo.points import LEAST_POINTS, points_from_flow, sample_grid
from dfvs_core.servo.pose import GoalPose
from dfvs_core.servo.structure.relative_depth import estimate_depth, in_metres, scaled
from dfvs_core.servo.task import ServoTask
from dfvs_core.servo.tracking import correct_goal, elapsed_s, predict_goal
from dfvs_core.servo.velocity import saturate, velocity_for

_NOISE_FACTOR = 10.0
_GO_ON = 0.5
"""Factor on the share of the view that must show the goal, once it has been found."""
_DIVIDED = 0.65
"""Weight kept over weight before, below which what a pose rejects is taken for wrong."""
_CLEAR_OVERLAP = 0.15
"""Share of the view that shows the goal from which on the gain is full."""
_CONSISTENT = 5.0
"""Residual over the flow's noise up to which the gain is full; at twice that it is least."""
_PROBED = 5.0
"""Error in tolerances above which the mounting is probed."""
_LEAST_CAUTION = 0.25
"""Least factor on the gain by a residual: where depth is not known yet, a flight has to begin."""


def servo_step(
    task: ServoTask, state: ServoState, inputs: ServoInputs
) -> tuple[ServoResult, ServoState]:
    """From one frame's correspondences to a velocity (DFVS Eq. (1), corrected).

    Returns
    -------
    ServoResult
        What is expected to go wrong is a status in it, never an exception.
    ServoState
        For the next frame.
    """
    if not inputs.flow.is_finite():
        return _refused(task, Status.NOT_FINITE, 0.0), state

    state = state.without_old_depth(inputs.t_capture_ns)
    a = inputs.attitude
    R_world_body = rotation_from_euler(a.roll_rad, a.pitch_rad, a.yaw_rad)
    inputs = replace(inputs, attitude=a.corrected(state.attitude_error_rad))

    # 1. Carry the estimate on to this frame by the odometry.
    dt_s = elapsed_s(inputs, state)
    estimate, T_predicted = predict_goal(task, state, inputs)
    unit_m = 1.0 if estimate is None else estimate.metres_per_unit
    unit_task = replace(task, unit_m=unit_m)
    T_guess = None if T_predicted is None else scaled(T_predicted, 1.0 / unit_m)

    # 2. Read the flow on a grid, and give every point a relative depth.
    samples = sample_grid(inputs.flow, task.config.stride_px)
    depth, depth_state = estimate_depth(unit_task, state, inputs, samples, T_guess)
    points = points_from_flow(samples, depth, task.camera, task.goal.camera)

    both = (None if state.last is None else state.last.samples, samples)
    monitor = state.monitor.follow_tilt(task, inputs.t_capture_ns, R_world_body, both, depth)

    # 3. Take both views to the gravity-aligned virtual camera.
    points = level_points(task, inputs.attitude, points)
    trusted = points.weight > task.config.min_confidence
    overlap = float(trusted.sum()) / samples.confidence.size
    state = replace(
        state,
        depth=depth_state,
        T_current_goal=T_predicted,
        estimate=estimate,
        last=LastFrame(inputs.t_capture_ns, inputs.attitude, inputs.velocity, samples),
        monitor=monitor,
        outliers=None,
    )
    least = task.config.min_overlap * (1.0 if T_guess is None else _GO_ON)
    if overlap < least or trusted.sum() < LEAST_POINTS:
        return _refused(task, Status.NO_OVERLAP, overlap), state
    points = points.select(trusted)

    # 4. Find where the goal is, and which points are out of line.
    pose = find_goal(unit_task, points, T_guess)
    matched, points = points, replace(points, weight=pose.weight)

    # 5. Solve for the motion, and filter it.
    measured, equations = wanted_motion(unit_task, points, pose)
    T_measured = unit_task.basis.exp(measured)
    position = T_measured[:3, 3]
    since_s = None if T_guess is None else dt_s
    estimate = correct_goal(task, estimate, position, points, since_s)
    # The filtered position, with the measured rotation.
    motion = task.basis.log(make_pose(T_measured[:3, :3], estimate.position_m))
    residual_px = pose.residual * task.camera.fx
    caution = _caution(task, overlap, residual_px)
    velocity = _velocity(task, motion, estimate, inputs, caution)

    # 6. Watch the motion, and judge.
    frame = FrameMotion(
        inputs.t_capture_ns,
        matched,
        pose.weight,
        estimate,
        motion,
        velocity,
        is_engaged=inputs.engaged,
        is_paused=inputs.paused,
    )
    measures, monitor = monitor.measure(task, frame)
    status = _judge(task, pose, equations, measures)
    flown = status is Status.OK
    result = ServoResult(
        status=status,
        velocity=_probed(task, inputs, measures, velocity, estimate)
        if flown
        else np.zeros_like(velocity),
        motion=motion,
        error_m=estimate.distance_m,
        error_rad=float(np.linalg.norm((task.basis.B @ motion)[3:])),
        median_error_px=measures.median_error_px,
        feature_error=measures.feature_error,
        mounting_score=measures.mounting_score,
        residual_px=residual_px,
        inlier_share=pose.inlier_share,
        overlap=overlap,
        condition=equations.condition,
        depth_m=unit_m * weighted_median(points.z_m, points.weight),
        reached=flown and residual_px < task.config.tolerance_px and measures.is_reached,
        uncertainty=_uncertainty(task, estimate, measures),
    )
    tilt = state.attitude_error_rad
    if flown and task.mount is not None:
        tilt = attitude_error(unit_task, points, pose, tilt)
    outliers = _outliers(task, pose, trusted).reshape(samples.confidence.shape)
    return result, replace(
        state,
        depth_map=in_metres(depth, estimate.metres_per_unit),
        depth_ns=inputs.t_capture_ns,
        T_current_goal=scaled(pose.T_current_goal, estimate.metres_per_unit),
        estimate=estimate,
        last=LastFrame(inputs.t_capture_ns, inputs.attitude, inputs.velocity, samples, position),
        monitor=monitor,
        attitude_error_rad=tilt,
        outliers=outliers,
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
    task: ServoTask, pose: GoalPose, equations: NormalEquations, measures: MotionMeasures
) -> Status:
    """Status of the frame: whether its velocity may be flown, and if not why not."""
    config = task.config
    unexplained = pose.residual * task.camera.fx
    tolerated = max(
        _NOISE_FACTOR * config.flow_noise_px, config.max_residual * measures.median_error_px
    )
    if pose.inlier_share < config.min_inliers or unexplained > tolerated:
        return Status.NO_AGREEMENT
    if equations.condition > config.max_condition:
        return Status.DEGENERATE
    if measures.is_stuck:
        return Status.STUCK
    return Status.OK


def _refused(task: ServoTask, status: Status, overlap: float) -> ServoResult:
    """Result of a frame that cannot be worked on: zero velocity, unknown error."""
    zero_motion = np.zeros(task.basis.size)
    unknown = float("inf")
    return ServoResult(
        status=status,
        velocity=zero_motion,
        motion=zero_motion,
        error_m=unknown,
        error_rad=unknown,
        median_error_px=unknown,
        feature_error=unknown,
        mounting_score=None,
        residual_px=unknown,
        inlier_share=0.0,
        overlap=overlap,
        condition=unknown,
        depth_m=0.0,
        reached=False,
    )


def _uncertainty(task: ServoTask, estimate: GoalEstimate, measures: MotionMeasures) -> Uncertainty:
    """Errors that the estimator states of itself."""
    return Uncertainty(
        error_m=estimate.distance_spread_m,
        scale=estimate.scale_spread,
        velocity_error=velocity_error(task, estimate),
        velocity_error_m_s=estimate.error_m_s,
        mean_error_m=measures.mean_error_m,
        spread_m=measures.spread_m,
    )


def _probed(
    task: ServoTask,
    inputs: ServoInputs,
    measures: MotionMeasures,
    velocity: FloatArray,
    estimate: GoalEstimate,
) -> FloatArray:
    """Velocity (d,) of the law, or a diagonal one until the mounting has passed; limited."""
    is_near = estimate.distance_m <= _PROBED * task.config.tolerance_m
    if not inputs.engaged or is_near or measures.has_mounting_passed:
        return velocity
    asked = probing_velocity(measures.mounting_score, inputs.t_capture_ns, velocity)
    return saturate(asked, task.limits)


def _caution(task: ServoTask, overlap: float, residual_px: float) -> float:
    """Factor on the gain, 0 to 1: low where little is seen, or a pose explains what is seen badly.

    A rigid scene of known depth leaves the noise of the flow alone.
    """
    excess = residual_px / (_CONSISTENT * task.config.flow_noise_px)
    return min(1.0, overlap / _CLEAR_OVERLAP) * min(max(2.0 - excess, _LEAST_CAUTION), 1.0)


def _velocity(
    task: ServoTask, motion: FloatArray, estimate: GoalEstimate, inputs: ServoInputs, caution: float
) -> FloatArray:
    """Velocity (d,) within the limits; ``caution`` is a factor on the gain.

    What the vehicle makes of a velocity differs by the error of its own estimate: that is taken
    off.
    """
    age_s = max(inputs.now_ns - inputs.t_capture_ns, 0) * 1e-9
    late_s = task.response_s + (age_s if task.mount is not None else 0.0)
    error = velocity_error(task, estimate)
    wanted = caution * velocity_for(motion, inputs.velocity + error, late_s, task.config)
    return saturate(wanted - error, task.limits)
