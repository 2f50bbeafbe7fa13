"""Goal pose filter: prediction by odometry, correction by images."""

import numpy as np

from dfvs_core.geometry.arrays import FloatArray
from dfvs_core.geometry.poses import make_pose, so3_exp
from dfvs_core.geometry.robust_weights import weighted_median
from dfvs_core.servo.exchange import ServoInputs, ServoState
from dfvs_core.servo.goal_filter import (
    SCALE_SPREAD,
    GoalEstimate,
    OdometryDelta,
    PositionMeasurement,
    begin,
    predict,
    update,
)
from dfvs_core.servo.level import level_rotation
from dfvs_core.servo.points import ServoPoints
from dfvs_core.servo.task import ServoTask


def scale_spread(task: ServoTask) -> float:
    """Relative standard deviation of a scale that nothing is known of; 0 for a metric depth."""
    if task.goal_depth is not None:
        return task.goal_depth.scale_spread
    return SCALE_SPREAD if task.config.depth == "motion" else 0.0


def elapsed_s(inputs: ServoInputs, state: ServoState) -> float:
    """Time since the last frame, s; 0 for a first one."""
    if state.last is None:
        return 0.0
    return max(inputs.t_capture_ns - state.last.t_capture_ns, 0) * 1e-9


def predict_goal(
    task: ServoTask, state: ServoState, inputs: ServoInputs
) -> tuple[GoalEstimate | None, FloatArray | None]:
    """Estimate in this frame's axes, and the predicted ``T_current_goal`` (4, 4), m."""
    estimate, last = state.estimate, state.last
    if estimate is None or last is None:
        return estimate, None
    moved = _odometry(task, state, inputs)
    estimate = predict(estimate, moved, task.config.constant_depth_m)
    if state.T_current_goal is None:
        return estimate, None
    R_current_goal = moved.R_earlier_current.T @ state.T_current_goal[:3, :3]
    return estimate, make_pose(R_current_goal, estimate.position_m)


def _odometry(task: ServoTask, state: ServoState, inputs: ServoInputs) -> OdometryDelta:
    """Motion since the last frame; a vehicle's in the axes of the virtual camera."""
    assert state.last is not None
    dt_s = elapsed_s(inputs, state)
    displacement_m = np.array(inputs.motion_m)
    velocity = task.basis.B @ inputs.velocity
    if task.mount is None:  # moves at one velocity from frame to frame
        R = so3_exp(velocity[3:] * dt_s)
        return OdometryDelta(dt_s, displacement_m, velocity[:3], R)
    then = state.last.attitude
    R = so3_exp(task.basis.B[3:, 3] * (inputs.attitude.yaw_rad - then.yaw_rad))
    velocity_then = task.basis.B @ state.last.velocity
    velocity_m_s = 0.5 * (velocity_then[:3] + R @ velocity[:3])
    # The odometry told the displacement by the attitude that it reported.
    R_level = level_rotation(task, state.reported_attitude)
    return OdometryDelta(dt_s, R_level @ displacement_m, velocity_m_s, R)


def correct_goal(
    task: ServoTask,
    estimate: GoalEstimate | None,
    position: FloatArray,
    points: ServoPoints,
    dt_s: float | None,
) -> GoalEstimate:
    """Estimate with a measured position (3,), in units; ``dt_s`` None: of a new goal.

    A depth that is a mere guess (constant, or the paper's from flow) contradicts the odometry
    without saying anything of it: then the measurement is the estimate.
    """
    weight = max(float(points.weight.sum()), 1e-9)
    spread = float((points.weight * points.depth_spread).sum()) / weight
    seen = PositionMeasurement(position, weighted_median(points.z_m, points.weight), spread)
    is_guess = task.config.depth in ("constant", "flow")
    if estimate is None or dt_s is None or is_guess:
        return begin(seen, scale_spread(task), estimate)
    return update(estimate, seen, dt_s, scale_spread(task))
