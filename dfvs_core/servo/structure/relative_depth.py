"""Relative depth of a frame's points, from earlier frames."""

from dataclasses import replace

import numpy as np

from dfvs_core.depth.depth_map import DepthMap
from dfvs_core.depth.flow_depth import FlowDepth
from dfvs_core.depth.motion import MotionDepth
from dfvs_core.depth.source import DepthState, EarlierView, GoalLink, constant_depth
from dfvs_core.errors import ConfigError
from dfvs_core.geometry.arrays import FloatArray
from dfvs_core.geometry.poses import invert_pose, make_pose
from dfvs_core.servo.exchange import Attitude, EarlierMatch, LastFrame, ServoInputs, ServoState
from dfvs_core.servo.goal_filter import restructured
from dfvs_core.servo.level import level_points, real_pose
from dfvs_core.servo.motion import find_goal, wanted_motion
from dfvs_core.servo.points import LEAST_POINTS, GridSamples, points_from_flow, sample_grid
from dfvs_core.servo.structure.two_view import earlier_view
from dfvs_core.servo.task import ServoTask
from dfvs_core.servo.tracking import scale_spread

_NOT_LEARNT = ("given", "constant", "flow")
"""Depths that are no structure of the goal view."""
_PASSES = 2
"""How often structure and pose of the goal are estimated in turn."""
_FIRST_PASSES = 5
"""The same for a first frame, whose pose is not predicted."""


def _noise(task: ServoTask) -> float:
    """Noise of a correspondence, normalised units."""
    return 1.5 * task.config.flow_noise_px / task.camera.fx


def motion_depth(task: ServoTask) -> MotionDepth:
    """Depth from motion; the camera sets the noise of a correspondence."""
    return MotionDepth(prior=task.config.constant_depth_m, pixel_noise=_noise(task))


def scaled(T: FloatArray, factor: float) -> FloatArray:
    """Pose (4, 4) with its translation times a factor."""
    return make_pose(T[:3, :3], factor * T[:3, 3])


def in_metres(depth: DepthMap, unit_m: float) -> DepthMap:
    """Depth map with its depth times the length of a unit, m."""
    return DepthMap(np.asarray(depth.z_m * np.float32(unit_m)), depth.validity)


def goal_link(
    task: ServoTask, attitude: Attitude, samples: GridSamples, T_current_goal: FloatArray
) -> GoalLink:
    """Where a frame's grid is seen in the goal view.

    Parameters
    ----------
    task : ServoTask
    attitude : Attitude
        Of the frame.
    samples : GridSamples
        Its flow to the goal.
    T_current_goal : (4, 4)
        Pose of the goal in the virtual camera, in units.
    """
    camera, stride = task.goal.camera, task.config.stride_px
    partners = samples.pixels + samples.flow
    rows, columns = _grid_size(camera.height, stride), _grid_size(camera.width, stride)
    index = np.floor(partners / stride).astype(np.intp)
    inside = ((index >= 0) & (index < [columns, rows])).all(axis=2)
    matched = inside & (samples.confidence > task.config.min_confidence)
    cell = np.where(matched, index[..., 1] * columns + index[..., 0], -1)
    T = invert_pose(real_pose(task, attitude, T_current_goal))
    return GoalLink(cell, camera.normalise(partners), T, (rows, columns))


def _grid_size(pixels: int, stride: int) -> int:
    return -(-pixels // stride)


def _first_link(
    task: ServoTask,
    state: ServoState,
    inputs: ServoInputs,
    samples: GridSamples,
    structure: DepthState,
) -> tuple[GoalLink | None, DepthState | None]:
    """Link of a first frame to its goal, by the network's structure of the goal view.

    None where hardly any of the goal is seen. Where the frame's depth is known from the flight to
    another goal, the structure takes its unit, so that the metric scale stays what it is.
    """
    source, shape = motion_depth(task), samples.confidence.shape
    last = LastFrame(inputs.t_capture_ns, inputs.attitude, inputs.velocity, samples)
    T = np.eye(4)
    link = goal_link(task, inputs.attitude, samples, T)
    if np.count_nonzero(link.cell >= 0) < LEAST_POINTS:
        return None, None
    for _ in range(_FIRST_PASSES):
        depth = source.estimate(shape, link, structure)
        T, _ = _goal_pose(task, last, depth, T)
        link = goal_link(task, inputs.attitude, samples, T)
    if state.depth is None and state.depth_map is not None:
        before = in_metres(state.depth_map, 1.0 / task.unit_m)
        depth = source.estimate(shape, link, structure)
        factor = _ratio(depth, before, link)
        structure = structure.scaled(1.0 / factor)
        link = replace(link, T_current_goal=scaled(link.T_current_goal, 1.0 / factor))
    return link, structure


def _ratio(depth: DepthMap, other: DepthMap, link: GoalLink) -> float:
    """Median ratio of two depths of a grid, where both are known and the goal is seen; or 1."""
    known = (link.cell >= 0) & depth.measured & other.measured
    if np.count_nonzero(known) < LEAST_POINTS:
        return 1.0
    return float(np.median(depth.z_m[known] / other.z_m[known]))


def estimate_depth(
    task: ServoTask,
    state: ServoState,
    inputs: ServoInputs,
    samples: GridSamples,
    T_guess: FloatArray | None,
) -> tuple[DepthMap, DepthState | None]:
    """Relative depth of the grid points, and the depth source's memory.

    ``T_guess`` (4, 4) is the predicted pose of the goal in the virtual camera, in units.
    """
    config, xy = task.config, task.camera.normalise(samples.pixels)
    if config.depth == "given":
        return _on_grid(inputs.given_depth, config.stride_px), state.depth
    if config.depth == "constant":
        return constant_depth(xy.shape[:2], config.constant_depth_m), state.depth
    if config.depth == "flow":
        earlier = None if inputs.earlier is None else _by_odometry(task, inputs.earlier)
        alpha, fallback_m = config.flow_depth_alpha, config.constant_depth_m
        source = FlowDepth(alpha, fallback_m=fallback_m, noise=_noise(task))
        return source.estimate(xy, earlier, state.depth)
    link, structure = None, state.depth
    if T_guess is not None:
        link = goal_link(task, inputs.attitude, samples, T_guess)
    elif task.goal_depth is not None:
        structure = structure or task.goal_depth.structure
        link, structure = _first_link(task, state, inputs, samples, structure)
    if (link is None or structure is None) and state.depth_map is not None:
        return in_metres(state.depth_map, 1.0 / task.unit_m), structure
    return motion_depth(task).estimate(xy.shape[:2], link, structure), structure


def _by_odometry(task: ServoTask, match: EarlierMatch) -> EarlierView:
    samples = sample_grid(match.flow, task.config.stride_px)
    xy = task.camera.normalise(samples.pixels + samples.flow)
    return EarlierView(xy, samples.confidence, match.T_earlier_current)


def _on_grid(depth: DepthMap | None, stride: int) -> DepthMap:
    if depth is None:
        raise ConfigError("depth source 'given' got no depth", "a depth map with every frame")
    grid = (slice(stride // 2, None, stride),) * 2
    return DepthMap(depth.z_m[grid], depth.validity[grid])


def observe_depth(task: ServoTask, state: ServoState, match: EarlierMatch) -> ServoState:
    """Learn about depth from the frame of the last ``servo_step`` and an earlier one.

    A comparison costs as much as the match with the goal; done after the velocity was sent, it
    serves the frames to come and delays none.
    """
    source = motion_depth(task)
    last, T_current_goal, estimate = state.last, state.T_current_goal, state.estimate
    if state.depth_map is None or last is None or T_current_goal is None or estimate is None:
        return state
    if task.config.depth in _NOT_LEARNT or last.position is None:
        return state
    unit_task = replace(task, unit_m=estimate.metres_per_unit)
    per_m = 1.0 / estimate.metres_per_unit
    relative = in_metres(state.depth_map, per_m)
    in_units = replace(match, T_earlier_current=scaled(match.T_earlier_current, per_m))
    view = earlier_view(task, in_units, relative)
    if view is None:
        return state
    xy = task.camera.normalise(last.samples.pixels)
    T_unit, learnt, depth, position = scaled(T_current_goal, per_m), None, relative, last.position
    for _ in range(_PASSES):
        # The goal view's structure depends on where the goal is, and that on the structure.
        link = goal_link(unit_task, last.attitude, last.samples, T_unit)
        memory = state.depth if state.depth is not None else source.adopt(xy, relative, link)
        learnt = source.observe(xy, view, link, memory)
        depth = source.estimate(xy.shape[:2], link, learnt)
        T_unit, position = _goal_pose(unit_task, last, depth, T_unit)
    assert learnt is not None
    if state.depth is None and np.count_nonzero(relative.measured) < LEAST_POINTS:
        # The first structure of all: its unit is that of the guess before, which the scale is of.
        factor = source.prior / float(np.median(depth.z_m))
        learnt, depth = learnt.scaled(factor), in_metres(depth, factor)
        T_unit, position = scaled(T_unit, factor), factor * position
    estimate = restructured(estimate, last.position, position, scale_spread(task))
    return replace(
        state,
        depth=learnt,
        depth_map=in_metres(depth, estimate.metres_per_unit),
        T_current_goal=scaled(T_unit, estimate.metres_per_unit),
        estimate=estimate,
        last=replace(last, position=position),
    )


def _goal_pose(
    task: ServoTask, last: LastFrame, depth: DepthMap, T_guess: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Pose (4, 4) of the goal in the last frame, and its position (3,) as the law has it, in units.

    ``task`` has the length of a unit.
    """
    points = points_from_flow(last.samples, depth, task.camera, task.goal.camera)
    points = level_points(task, last.attitude, points)
    points = points.select(points.weight > task.config.min_confidence)
    pose = find_goal(task, points, T_guess)
    measured, _ = wanted_motion(task, replace(points, weight=pose.weight), pose)
    return pose.T_current_goal, task.basis.exp(measured)[:3, 3]
