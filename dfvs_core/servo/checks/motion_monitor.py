"""Motion monitor: feature error, motion-direction check, progress and stop rule, as numbers.

It decides nothing: the servo step draws the conclusions.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np

from dfvs_core.depth.depth_map import DepthMap
from dfvs_core.geometry.arrays import FloatArray
from dfvs_core.geometry.robust_weights import weighted_median
from dfvs_core.messages.link import MOUNTING_SCORE
from dfvs_core.servo.checks.feature_error import Reference, feature_error
from dfvs_core.servo.checks.image_turn import image_turn, point_tracks
from dfvs_core.servo.checks.mounting import (
    MountingState,
    begin_mounting,
    follow_mounting,
    mounting_score,
)
from dfvs_core.servo.checks.stop import (
    StopState,
    error_sample,
    is_reached,
    is_stuck,
    update_stop,
    window_error,
)
from dfvs_core.servo.goal_filter import GoalEstimate
from dfvs_core.servo.points import GridSamples, ServoPoints
from dfvs_core.servo.task import ServoTask

_APPROACH_M_S = 0.02
"""Speed towards the goal, m/s or rad/s, below which no progress is expected."""


@dataclass(frozen=True, slots=True)
class FrameMotion:
    """Motion of one frame.

    Parameters
    ----------
    t_ns : int
        When it was taken.
    points : ServoPoints
        N points, all that were matched.
    weight : (N,)
        Of each point in the goal's pose.
    estimate : GoalEstimate
        Filtered position of the goal.
    motion, velocity : (d,)
        From here to the goal, m and rad, and what is flown, m/s and rad/s.
    is_engaged : bool
        Whether the vehicle follows.
    is_paused : bool
        Whether it is held, and may follow again.
    """

    t_ns: int
    points: ServoPoints
    weight: FloatArray
    estimate: GoalEstimate
    motion: FloatArray
    velocity: FloatArray
    is_engaged: bool
    is_paused: bool = False


@dataclass(frozen=True, slots=True)
class MotionMeasures:
    """Numbers of one frame; see ``ServoResult`` for the first three.

    ``has_mounting_passed`` says that the score has told a right mounting in this engagement.
    ``mean_error_m`` and ``spread_m`` are the mean error of the last second and the spread about
    it; ``is_reached`` and ``is_stuck`` are those of :mod:`dfvs_core.servo.checks.stop`.
    """

    feature_error: float
    median_error_px: float
    mounting_score: float | None
    has_mounting_passed: bool
    mean_error_m: float
    spread_m: float
    is_reached: bool
    is_stuck: bool


@dataclass(frozen=True, slots=True)
class MotionMonitor:
    """Memory of what watches the motion: immutable, each frame makes the next one.

    Parameters
    ----------
    mounting : MountingState, optional
        Regression of the images' tilt; of a vehicle alone.
    reference : Reference, optional
        Frame that the feature error is relative to.
    stop : StopState
        Recent errors and progress.
    has_mounting_passed : bool
        Whether the score has told a right mounting in this engagement.
    """

    mounting: MountingState | None = None
    reference: Reference | None = None
    stop: StopState = field(default_factory=StopState)
    has_mounting_passed: bool = False

    def without_goal(self) -> MotionMonitor:
        """Memory of the mounting alone."""
        return MotionMonitor(self.mounting, has_mounting_passed=self.has_mounting_passed)

    def follow_tilt(
        self,
        task: ServoTask,
        t_ns: int,
        R_world_body: FloatArray,
        samples: tuple[GridSamples | None, GridSamples],
        depth: DepthMap,
    ) -> MotionMonitor:
        """Take in a frame's turn.

        Parameters
        ----------
        task : ServoTask
        t_ns : int
            When it was taken.
        R_world_body : (3, 3)
            Attitude of the body.
        samples : tuple of GridSamples
            Flow of the last frame, None before the first one, and of this one.
        depth : DepthMap
            Of this frame, on the grid.
        """
        if task.mount is None:
            return self
        now, (earlier, current) = begin_mounting(t_ns, R_world_body), samples
        if self.mounting is None or earlier is None:
            return replace(self, mounting=now)
        cameras, z = (task.camera, task.goal.camera), depth.z_m.astype(np.float64)
        tracks = point_tracks((earlier, current), z, cameras, task.config.min_confidence)
        R_body_camera = task.mount.T_body_camera()[:3, :3]
        mounting = follow_mounting(self.mounting, now, image_turn(tracks), R_body_camera)
        return replace(self, mounting=mounting)

    def measure(self, task: ServoTask, frame: FrameMotion) -> tuple[MotionMeasures, MotionMonitor]:
        """Numbers of a frame whose goal pose is known, and the memory after it."""
        config, estimate = task.config, frame.estimate
        spacing = config.stride_px / task.camera.fx
        before = self.reference if frame.is_engaged else None
        length, reference = feature_error(frame.points, spacing, before)
        turn_rad = (task.basis.B @ frame.motion)[3:]
        sample = error_sample(frame.t_ns, estimate, turn_rad, length, config)
        is_asked = frame.is_engaged and _may_approach(task, frame)
        stop = update_stop(self.stop, sample, is_asked, frame.is_paused)
        window = window_error(stop)
        lengths = np.linalg.norm(frame.points.error, axis=1)
        score = mounting_score(self.mounting)
        is_right = frame.is_engaged and score is not None and score >= MOUNTING_SCORE
        has_passed = is_right or (
            self.has_mounting_passed and (frame.is_engaged or frame.is_paused)
        )
        measures = MotionMeasures(
            feature_error=length,
            median_error_px=weighted_median(lengths, frame.weight) * task.camera.fx,
            mounting_score=score,
            has_mounting_passed=has_passed,
            mean_error_m=window.mean[0] * config.tolerance_m,
            spread_m=window.spread[0] * config.tolerance_m,
            is_reached=is_reached(stop),
            is_stuck=is_stuck(stop, config.progress_s),
        )
        after = replace(self, reference=reference, stop=stop, has_mounting_passed=has_passed)
        return measures, after


def velocity_error(task: ServoTask, estimate: GoalEstimate) -> FloatArray:
    """True velocity minus the odometry's in the components of the basis (d,)."""
    error = np.zeros(task.basis.size)
    error[:3] = task.basis.B[:3, :3].T @ estimate.velocity_error_m_s
    return error


def _may_approach(task: ServoTask, frame: FrameMotion) -> bool:
    """Whether a vehicle that flies this velocity surely comes nearer.

    Against a velocity error as large as the speed limit it does not, and that is no fault.
    """
    length = float(np.linalg.norm(frame.motion))
    if length <= 0.0:
        return True
    error = velocity_error(task, frame.estimate)
    doubt = max(2.0 * frame.estimate.error_m_s, 0.5 * float(np.linalg.norm(error)), _APPROACH_M_S)
    return float((frame.velocity + error) @ frame.motion) / length > doubt
