"""One trial: a method leads a free camera through a task, and every step is written down."""

import math
from dataclasses import dataclass, replace

import numpy as np

from dfvs_bench.methods.method import (
    FRAME_PERIOD_S,
    Decision,
    GoalObservation,
    Observation,
    ServoMethod,
)
from dfvs_bench.trials.perturbation import Disturbance, undisturbed
from dfvs_bench.trials.statistics import settled_index
from dfvs_bench.trials.task import BenchTask
from dfvs_core.depth.depth_map import DepthMap
from dfvs_core.errors import ConfigError, GeometryError
from dfvs_core.geometry.arrays import FloatArray
from dfvs_core.geometry.poses import (
    check_pose,
    make_pose,
    pose_error,
    quaternion_from_rotation,
    rotation_from_quaternion,
    se3_log,
)
from dfvs_sim.render.renderer import Renderer, View

CONVERGED_M, CONVERGED_RAD = 0.04, math.radians(1.0)
"""The paper's criterion."""

SKY_DEPTH_M = 100.0
_NO_WAY_M = 1e-6
_DIVERGED_FACTOR, _DIVERGED_MARGIN_M = 3.0, 1.0


@dataclass(frozen=True, slots=True)
class Step:
    """One iteration: where the camera was, what the method saw of its error and what it did."""

    position_m: tuple[float, ...]
    """NED."""
    distance_m: float
    angle_rad: float
    """Both are the true error to the goal."""
    error: float | None
    """The method's own error; None where it had none."""
    velocity: tuple[float, ...]
    """Twist (6,) in the camera's frame, m/s and rad/s at ``FRAME_PERIOD_S``."""

    @property
    def meets_criterion(self) -> bool:
        """Whether the error is within 4 cm and 1 degree."""
        return self.distance_m < CONVERGED_M and self.angle_rad < CONVERGED_RAD


@dataclass(frozen=True, slots=True)
class Trial:
    """What came of a method in a task.

    ``end`` says why it ended: ``done`` by the method's own stop rule, ``iterations``, ``left``
    (it went far away), or the method's reason to give up. ``T_world_end`` is row by row, NED.
    """

    steps: tuple[Step, ...]
    end: str
    T_world_end: tuple[float, ...]

    @property
    def final(self) -> Step:
        """The last step: the method ended there."""
        return self.steps[-1]

    @property
    def iterations(self) -> int:
        """How many motions were made."""
        return len(self.steps) - 1

    @property
    def converged(self) -> bool:
        """Whether it ended within 4 cm and 1 degree."""
        return self.final.meets_criterion

    @property
    def is_false_done(self) -> bool:
        """Whether its own stop rule ended it three times the criterion from the goal or more."""
        far = self.final.distance_m >= 3 * CONVERGED_M or self.final.angle_rad >= 3 * CONVERGED_RAD
        return self.end == "done" and far

    @property
    def iterations_to_criterion(self) -> int | None:
        """Motions after which it was within 4 cm and 1 degree for good, or None."""
        return settled_index([step.meets_criterion for step in self.steps])

    @property
    def path_m(self) -> float:
        """Length of the camera's path."""
        positions = np.array([step.position_m for step in self.steps])
        return float(np.linalg.norm(np.diff(positions, axis=0), axis=1).sum())

    @property
    def path_ratio(self) -> float | None:
        """Path over the straight line from start to goal; None where that is nothing."""
        straight_m = self.steps[0].distance_m
        return self.path_m / straight_m if straight_m > _NO_WAY_M else None


def goal_observation(task: BenchTask, renderer: Renderer) -> GoalObservation:
    """Take the image to go to."""
    view = renderer.render(task.camera, task.T_world_goal, antialias=True)
    return GoalObservation(task.camera, view.image, true_depth(view))


def run_trial(
    task: BenchTask,
    method: ServoMethod,
    renderer: Renderer,
    most_iterations: int,
    disturb: Disturbance = undisturbed,
) -> Trial:
    """Lead the camera until the method is done, gives up or goes astray, or time is over.

    The method is given what ``disturb`` makes of each rendered view.

    Raises
    ------
    DfvsError
        If the method decides on a motion that is no pose, an error that is no number, or to give
        up without saying why.
    """
    T = task.T_world_start
    steps: list[Step] = []
    end = "iterations"
    reach_m = _DIVERGED_FACTOR * task.initial_error[0] + _DIVERGED_MARGIN_M
    for k in range(most_iterations + 1):
        view = disturb(k, renderer.render(task.camera, T, antialias=True))
        decision = _checked(method.decide(Observation(k, view.image, true_depth(view), T)), method)
        steps.append(_step(task, T, decision))
        if decision.done or decision.lost:
            end = "done" if decision.done else decision.lost
            break
        if steps[-1].distance_m > reach_m:
            end = "left"
            break
        if k < most_iterations:
            T = T @ decision.T_current_next
            # Takes out what rounding adds to a rotation over thousands of steps.
            R = rotation_from_quaternion(quaternion_from_rotation(T[:3, :3]))
            T = make_pose(R, T[:3, 3])
    at_rest = replace(steps[-1], velocity=(0.0,) * 6)
    return Trial((*steps[:-1], at_rest), end, tuple(T.ravel().tolist()))


def true_depth(view: View) -> DepthMap:
    """Depth of a rendered view; the sky is far and not valid."""
    seen = view.depth_m > 0
    z = np.where(seen, view.depth_m, np.float32(SKY_DEPTH_M))
    return DepthMap(z, seen.astype(np.float32))


def _checked(decision: Decision, method: ServoMethod) -> Decision:
    """Decision with plain numbers and a text, which a record can hold."""
    name = type(method).__name__
    if not isinstance(decision.lost, str):
        raise ConfigError(f"lost of {name} is {decision.lost!r}", "why it gives up, or ''")
    try:
        T_current_next = check_pose(decision.T_current_next, f"T_current_next of {name}")
    except (TypeError, ValueError) as error:
        raise GeometryError(f"T_current_next of {name} ({error})", "a pose (4, 4)") from error
    try:
        return replace(decision, T_current_next=T_current_next, error=float(decision.error))
    except (TypeError, ValueError) as error:
        raise ConfigError(f"error of {name} is {decision.error!r}", "a number") from error


def _step(task: BenchTask, T: FloatArray, decision: Decision) -> Step:
    distance_m, angle_rad = pose_error(T, task.T_world_goal)
    velocity = se3_log(decision.T_current_next) / FRAME_PERIOD_S
    error = decision.error if math.isfinite(decision.error) else None
    return Step(tuple(T[:3, 3].tolist()), distance_m, angle_rad, error, tuple(velocity.tolist()))
