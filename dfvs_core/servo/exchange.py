"""Inputs, state and result of ``servo_step``."""

from __future__ import annotations

import enum
from dataclasses import dataclass, field, replace

import numpy as np

from dfvs_core.depth.depth_map import DepthMap
from dfvs_core.depth.source import DepthState
from dfvs_core.geometry.arrays import BoolArray, FloatArray
from dfvs_core.matching.correspondence import FlowField
from dfvs_core.servo.checks.motion_monitor import MotionMonitor
from dfvs_core.servo.goal_filter import GoalEstimate
from dfvs_core.servo.points import LEAST_POINTS, GridSamples

_LEAST_DEPTH_M = 1e-3
_MEMORY_NS = 5_000_000_000
"""Age of a depth map up to which it stands in for that of a frame which does not show the goal."""


class Status(enum.Enum):
    """Status of a frame; one that is not OK must not be flown."""

    OK = "ok"
    NOT_FINITE = "the flow network gave values that are not finite"
    NO_OVERLAP = "too little of the view shows the goal"
    NO_AGREEMENT = "the correspondences do not agree on one motion"
    DEGENERATE = "the view does not determine every direction of motion"
    SWAPPED_CHANNELS = "red and blue are exchanged against the goal image"
    FALSE_GOAL = "what counts as the goal here does not look like the goal image"
    STUCK = "the error has not fallen for too long"


@dataclass(frozen=True, slots=True)
class Attitude:
    """Roll and pitch of the body against gravity, and its heading (unwrapped), rad."""

    roll_rad: float = 0.0
    pitch_rad: float = 0.0
    yaw_rad: float = 0.0

    def corrected(self, error_rad: tuple[float, float]) -> Attitude:
        """Attitude without an estimated error of roll and pitch (2,), rad."""
        roll, pitch = self.roll_rad - error_rad[0], self.pitch_rad - error_rad[1]
        return Attitude(roll, pitch, self.yaw_rad)


@dataclass(frozen=True, slots=True)
class EarlierMatch:
    """Correspondences with an earlier frame of the same camera, and the motion since.

    ``T_earlier_current`` (4, 4) is the camera's motion from attitude and velocity, m.
    """

    flow: FlowField
    T_earlier_current: FloatArray


@dataclass(frozen=True, slots=True)
class ServoInputs:
    """One frame's inputs.

    Parameters
    ----------
    now_ns, t_capture_ns : int
        Monotonic time now and when the frame was taken.
    flow : FlowField
        From the current view to the goal image.
    attitude : Attitude
        Of the body at capture time (ignored by a free camera).
    velocity : (d,)
        How the vehicle moves, in the components of the basis, m/s and rad/s.
    motion_m : (3,)
        How far the camera moved since the last frame, in the optical axes it had then.
    earlier : EarlierMatch or None
        For depth from motion and from flow.
    given_depth : DepthMap or None
        (H, W) in the current view, for ``depth = "given"``.
    engaged : bool
        Whether the vehicle is following; progress is only asked for then.
    paused : bool
        Whether it is held instead, and may follow again: the time without progress stands still.
    """

    now_ns: int
    t_capture_ns: int
    flow: FlowField
    velocity: FloatArray
    attitude: Attitude = field(default_factory=Attitude)
    motion_m: tuple[float, float, float] = (0.0, 0.0, 0.0)
    earlier: EarlierMatch | None = None
    given_depth: DepthMap | None = None
    engaged: bool = True
    paused: bool = False


@dataclass(frozen=True, slots=True)
class LastFrame:
    """What is kept of a frame: capture time, attitude, velocity (d,) and the samples of its flow.

    The attitude is that which was reported, less ``ServoState.attitude_error_rad``.
    ``position`` (3,) is the goal's, in units, as it was measured; None where it was not.
    """

    t_capture_ns: int
    attitude: Attitude
    velocity: FloatArray
    samples: GridSamples
    position: FloatArray | None = None


@dataclass(frozen=True, slots=True)
class ServoState:
    """Memory from frame to frame.

    ``depth`` is relative, in units whose length in metres is in ``estimate``; ``depth_map``, on the
    grid, is metric and of the last frame that showed the goal, captured at ``depth_ns``.
    ``T_current_goal`` is of the last frame and metric. ``outliers`` (h, w) marks which
    points of that grid contradict the motion to the goal, where it explains the others and they are
    many. ``last`` is the last frame, None before the first one.
    """

    depth: DepthState | None = None
    depth_map: DepthMap | None = None
    depth_ns: int = 0
    T_current_goal: FloatArray | None = None
    estimate: GoalEstimate | None = None
    last: LastFrame | None = None
    monitor: MotionMonitor = field(default_factory=MotionMonitor)
    attitude_error_rad: tuple[float, float] = (0.0, 0.0)
    outliers: BoolArray | None = None

    @property
    def reported_attitude(self) -> Attitude:
        """Attitude of the last frame, of which there is one, as the odometry reported it."""
        assert self.last is not None
        roll, pitch = self.attitude_error_rad
        return self.last.attitude.corrected((-roll, -pitch))

    def without_old_depth(self, t_capture_ns: int) -> ServoState:
        """Memory for a frame; a depth map of seconds ago shows another view."""
        if t_capture_ns - self.depth_ns <= _MEMORY_NS:
            return self
        return replace(self, depth_map=None, estimate=None if self.depth is None else self.estimate)

    def without_goal(self) -> ServoState:
        """Memory of depth, scale, odometry and mounting alone, to begin with another goal.

        The scale is that of a measured depth: without one it is forgotten.
        """
        last = self.last
        if last is not None:  # the next flow leads to another image
            unknown = replace(last.samples, confidence=np.zeros_like(last.samples.confidence))
            attitude = self.reported_attitude
            last = replace(last, attitude=attitude, samples=unknown, position=None)
        depth_map = self.depth_map
        measured = 0 if depth_map is None else np.count_nonzero(depth_map.measured)
        return ServoState(
            depth_map=depth_map,
            depth_ns=self.depth_ns,
            estimate=self.estimate if measured >= LEAST_POINTS else None,
            last=last,
            monitor=self.monitor.without_goal(),
        )


@dataclass(frozen=True, slots=True)
class Uncertainty:
    """What the servo's estimator knows of its own errors.

    Parameters
    ----------
    error_m : float
        Standard deviation of the distance to the goal, m.
    scale : float
        Relative standard deviation of the metric scale.
    velocity_error : (d,)
        True velocity minus the odometry's, m/s, in the components of the basis; 0 for rotations.
    velocity_error_m_s : float
        Expected size of the odometry's error, standard deviation per axis, m/s.
    mean_error_m, spread_m : float
        Mean error of the last second and the spread about it, m.
    """

    error_m: float
    scale: float
    velocity_error: FloatArray
    velocity_error_m_s: float
    mean_error_m: float
    spread_m: float


@dataclass(frozen=True, slots=True)
class ServoResult:
    """Result of one frame.

    Parameters
    ----------
    status : Status
        Whether the velocity may be flown; it is zero unless OK.
    velocity : (d,)
        m/s and rad/s in the components of the basis.
    motion : (d,)
        From here to the goal, m and rad: the estimated error.
    error_m, error_rad : float
        Length of the translation and angle of the rotation in ``motion``.
    median_error_px : float
        Weighted median length of the flow to the goal, after taking both views level.
    feature_error : float
        The same in normalised units, of the same features from frame to frame while engaged
        (:mod:`dfvs_core.servo.checks.feature_error`): what comes into view does not change it, and
        ``error_m`` may jump as depth becomes known.
    mounting_score : float or None
        Test statistic of the camera's mounting (:mod:`dfvs_core.servo.checks.mounting`); None where
        nothing can be told.
    residual_px : float
        Weighted median reprojection error of the estimated motion.
    inlier_share, overlap : float
        Share of the correspondences that agree; share of the view that shows the goal.
    condition : float
        Condition number of the scaled normal equations.
    depth_m : float
        Median depth of the points used.
    reached : bool
        The stop rule is satisfied in this frame.
    uncertainty : Uncertainty or None
        Of the error and of the odometry; None where the frame was refused.
    """

    status: Status
    velocity: FloatArray
    motion: FloatArray
    error_m: float
    error_rad: float
    median_error_px: float
    feature_error: float
    mounting_score: float | None
    residual_px: float
    inlier_share: float
    overlap: float
    condition: float
    depth_m: float
    reached: bool
    uncertainty: Uncertainty | None = None

    @property
    def distance_over_depth(self) -> float:
        """Distance to the goal over the scene's depth, whose scale need not be known for it."""
        return self.error_m / max(self.depth_m, _LEAST_DEPTH_M)
