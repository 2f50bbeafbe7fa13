"""One frame's way from correspondences to a velocity: ``servo_step``, a pure function.

The service, the simulator and the benchmark all call this one.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from dfvs_core.arrays import BoolArray, FloatArray
from dfvs_core.correspondence import DepthMap
from dfvs_core.poses import make_pose, rotation_from_euler
from dfvs_core.servo.exchange import (
    LastFrame,
    ServoInputs,
    ServoResult,
    ServoState,
    Uncertainty,
    Verdict,
)
from dfvs_core.servo.feature_error import feature_error
from dfvs_core.servo.goal_filter import GoalEstimate
from dfvs_core.servo.image_turn import image_turn, point_tracks
from dfvs_core.servo.law import NormalEquations
from dfvs_core.servo.level import attitude_error, corrected, level_points
from dfvs_core.servo.motion import find_goal, is_clear, wanted_motion
from dfvs_core.servo.mounting import (
    MountingState,
    begin_mounting,
    follow_mounting,
    mounting_score,
    probing_velocity,
)
from dfvs_core.servo.points import GridSamples, ServoPoints, points_from_flow, sample_grid
from dfvs_core.servo.pose import GoalPose
from dfvs_core.servo.stop import (
    StopState,
    error_sample,
    is_reached,
    is_stuck,
    update_stop,
    window_error,
)
from dfvs_core.servo.structure import estimate_depth, in_metres, scaled
from dfvs_core.servo.task import ServoTask
from dfvs_core.servo.tracking import correct_goal, elapsed_s, predict_goal
from dfvs_core.servo.velocity import AdaptiveGain, saturate, velocity_for
from dfvs_core.servo.weights import weighted_median

_MIN_POINTS = 24
_NOISE_FACTOR = 10.0
_GO_ON = 0.5
"""Factor on the share of the view that must show the goal, once it has been found."""
_DIVIDED = 0.65
"""Weight kept over weight before, below which what a pose rejects is taken for wrong."""
_APPROACH_M_S = 0.02
"""Speed towards the goal, m/s or rad/s, below which no progress is expected."""
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
        What is expected to go wrong is a verdict in it, never an exception.
    ServoState
        For the next frame.
    """
    if not inputs.flow.is_finite():
        return _refused(task, Verdict.NOT_FINITE, 0.0), state

    mounting_inputs = inputs
    inputs = replace(inputs, attitude=corrected(inputs.attitude, state.attitude_error_rad))

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

    mounting = check_mounting(task, state, mounting_inputs, samples, depth)

    # 3. Take both views to the gravity-aligned virtual camera.
    points = level_points(task, inputs.attitude, points)
    trusted = points.weight > task.config.min_confidence
    overlap = float(trusted.sum()) / samples.confidence.size
    state = replace(
        state,
        depth=depth_state,
        depth_map=in_metres(depth, unit_m),
        T_current_goal=T_predicted,
        estimate=estimate,
        last=LastFrame(inputs.t_capture_ns, inputs.attitude, samples),
        mounting=mounting,
        outliers=None,
    )
    least = task.config.min_overlap * (1.0 if T_guess is None else _GO_ON)
    if overlap < least or trusted.sum() < _MIN_POINTS:
        return _refused(task, Verdict.NO_OVERLAP, overlap), state
    points = points.select(trusted)

    # 4. Find where the goal is, and which points are out of line.
    pose = find_goal(unit_task, points, T_guess)
    before = state.reference if inputs.engaged else None
    spacing = task.config.stride_px / task.camera.fx
    left, reference = feature_error(points, spacing, before)
    points = replace(points, weight=pose.weight)

    # 5. Solve for the motion, and filter it.
    measured, equations = wanted_motion(unit_task, points, pose)
    position = unit_task.basis.exp(measured)[:3, 3]
    since_s = None if T_guess is None else dt_s
    estimate = correct_goal(task, estimate, position, points, since_s)
    motion = _filtered_motion(task, unit_task, estimate, measured)
    residual_px = pose.residual * task.camera.fx
    score, caution = mounting_score(mounting), _caution(task, overlap, residual_px)
    velocity = _velocity(task, motion, estimate, inputs, caution)

    # 6. Judge.
    turn_rad = (task.basis.B @ motion)[3:]
    sample = error_sample(inputs.t_capture_ns, estimate.position_m, turn_rad, left, task.config)
    may_approach = _may_approach(task, estimate, motion, velocity)
    stop = update_stop(state.stop, sample, inputs.engaged and may_approach)
    feature_error_px = _feature_error_px(task, points)
    verdict = _judge(task, pose, equations, feature_error_px, stop)
    flown = verdict is Verdict.OK
    result = ServoResult(
        verdict=verdict,
        velocity=_probed(task, inputs, score, velocity, estimate)
        if flown
        else np.zeros_like(velocity),
        motion=motion,
        error_m=estimate.distance_m,
        error_rad=_angle(task, motion),
        feature_error_px=feature_error_px,
        feature_error=left,
        mounting_score=score,
        residual_px=residual_px,
        inlier_share=pose.inlier_share,
        overlap=overlap,
        condition=equations.condition,
        depth_m=unit_m * weighted_median(points.z_m, points.weight),
        reached=flown and residual_px < task.config.tolerance_px and is_reached(stop),
        uncertainty=_uncertainty(task, estimate, stop),
    )
    tilt = state.attitude_error_rad
    if flown and task.mount is not None:
        tilt = attitude_error(unit_task, points, pose, tilt)
    outliers = _outliers(task, pose, trusted).reshape(samples.confidence.shape)
    return result, replace(
        state,
        T_current_goal=scaled(pose.T_current_goal, estimate.metres_per_unit),
        estimate=estimate,
        last=LastFrame(inputs.t_capture_ns, inputs.attitude, samples, position),
        stop=stop,
        reference=reference,
        attitude_error_rad=tilt,
        outliers=outliers,
    )


def _filtered_motion(
    task: ServoTask, unit_task: ServoTask, estimate: GoalEstimate, measured: FloatArray
) -> FloatArray:
    """Motion (d,) to the goal, m and rad: the filtered position with the measured rotation."""
    T = unit_task.basis.exp(measured)
    return task.basis.log(make_pose(T[:3, :3], estimate.position_m))


def _angle(task: ServoTask, motion: FloatArray) -> float:
    return float(np.linalg.norm((task.basis.B @ motion)[3:]))


def _outliers(task: ServoTask, pose: GoalPose, trusted: BoolArray) -> BoolArray:
    """Which of the grid's points (N,) contradict a pose that explains those that are trusted.

    No point where they are few: another surface, whose depth is not known yet, may be among them.
    """
    outliers = np.zeros_like(trusted)
    if is_clear(task, pose) and pose.inlier_share < _DIVIDED:
        outliers[trusted] = pose.weight <= 0.0
    return outliers


def check_mounting(
    task: ServoTask, state: ServoState, inputs: ServoInputs, samples: GridSamples, depth: DepthMap
) -> MountingState | None:
    """Regression of the images' tilt after this frame; of a vehicle alone."""
    if task.mount is None:
        return None
    a = inputs.attitude
    now = begin_mounting(
        inputs.t_capture_ns, rotation_from_euler(a.roll_rad, a.pitch_rad, a.yaw_rad)
    )
    if state.mounting is None or state.last is None:
        return now
    turn = None
    if state.last.t_capture_ns == state.mounting.t_ns:
        cameras = (task.camera, task.goal.camera)
        both = (state.last.samples, samples)
        z = depth.z_m.astype(np.float64)
        turn = image_turn(point_tracks(both, z, cameras, task.config.min_confidence))
    return follow_mounting(state.mounting, now, turn, task.mount.T_body_camera()[:3, :3])


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
        mounting_score=None,
        residual_px=unknown,
        inlier_share=0.0,
        overlap=overlap,
        condition=unknown,
        depth_m=0.0,
        reached=False,
    )


def _feature_error_px(task: ServoTask, points: ServoPoints) -> float:
    lengths = np.linalg.norm(points.error, axis=1)
    return weighted_median(lengths, points.weight) * task.camera.fx


def _uncertainty(task: ServoTask, estimate: GoalEstimate, stop: StopState) -> Uncertainty:
    """What is told of the estimator's own errors."""
    window = window_error(stop)
    return Uncertainty(
        error_m=estimate.distance_spread_m,
        scale=estimate.scale_spread,
        velocity_error=_velocity_error(task, estimate),
        velocity_error_m_s=estimate.error_m_s,
        mean_error_m=window.mean[0] * task.config.tolerance_m,
        spread_m=window.spread[0] * task.config.tolerance_m,
    )


def _may_approach(
    task: ServoTask, estimate: GoalEstimate, motion: FloatArray, velocity: FloatArray
) -> bool:
    """Tell whether a vehicle that flies this velocity (d,) surely comes nearer.

    Against a velocity error as large as the speed limit it does not, and that is no fault.
    """
    length = float(np.linalg.norm(motion))
    if length <= 0.0:
        return True
    error = _velocity_error(task, estimate)
    doubt = max(2.0 * estimate.error_m_s, 0.5 * float(np.linalg.norm(error)), _APPROACH_M_S)
    return float((velocity + error) @ motion) / length > doubt


def _velocity_error(task: ServoTask, estimate: GoalEstimate) -> FloatArray:
    """True velocity minus the odometry's in the components of the basis (d,)."""
    error = np.zeros(task.basis.size)
    error[:3] = task.basis.B[:3, :3].T @ estimate.velocity_error_m_s
    return error


def _probed(
    task: ServoTask,
    inputs: ServoInputs,
    score: float | None,
    velocity: FloatArray,
    estimate: GoalEstimate,
) -> FloatArray:
    """Velocity (d,) of the law, or one to the side while the mounting is undecided."""
    if not inputs.engaged or estimate.distance_m <= _PROBED * task.config.tolerance_m:
        return velocity
    return probing_velocity(score, inputs.t_capture_ns, velocity)


def _caution(task: ServoTask, overlap: float, residual_px: float) -> float:
    """Factor on the gain, 0 to 1: low where little is seen, or a pose explains what is seen badly.

    A rigid scene of known depth leaves the noise of the flow alone.
    """
    excess = residual_px / (_CONSISTENT * task.config.flow_noise_px)
    return min(1.0, overlap / _CLEAR_OVERLAP) * min(max(2.0 - excess, _LEAST_CAUTION), 1.0)


def _velocity(
    task: ServoTask,
    motion: FloatArray,
    estimate: GoalEstimate,
    inputs: ServoInputs,
    caution: float,
) -> FloatArray:
    """Velocity (d,) within the limits; ``caution`` is a factor on the gain.

    What the vehicle makes of a velocity differs by the error of its own estimate: that is taken
    off.
    """
    age_s = max(inputs.now_ns - inputs.t_capture_ns, 0) * 1e-9
    late_s = task.response_s + (age_s if task.mount is not None else 0.0)
    config = task.config
    gain = AdaptiveGain(config.gain_far, config.gain_near, config.gain_error)
    error = _velocity_error(task, estimate)
    wanted = caution * velocity_for(motion, inputs.velocity + error, late_s, gain)
    return saturate(wanted - error, task.limits)
