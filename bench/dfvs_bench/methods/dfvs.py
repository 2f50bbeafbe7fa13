"""The product itself as a method: its own pipeline, with all six degrees of freedom."""

import math
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from dfvs_bench.methods.method import FRAME_PERIOD_S, Decision, GoalObservation, Observation
from dfvs_core.depth.network import DepthEstimator
from dfvs_core.geometry.arrays import FloatArray
from dfvs_core.geometry.poses import make_pose, se3_exp, so3_exp
from dfvs_core.matching.matcher import Matcher
from dfvs_core.messages.frame import Frame
from dfvs_core.messages.goal import Goal, GoalSidecar
from dfvs_core.perception.pipeline import Pipeline
from dfvs_core.perception.vehicle_history import Motion
from dfvs_core.servo.config import DepthChoice, ServoConfig
from dfvs_core.servo.exchange import Status
from dfvs_core.servo.task import ServoTask
from dfvs_sim.dynamics.estimate_errors import ErrorProcess, EstimateGrade, errors_of

_PERIOD_NS = round(FRAME_PERIOD_S * 1e9)
_REFUSALS = 5
"""Frames refused in a row after which the goal counts as lost."""

MAX_SPEED_M_S, MAX_TURN_RAD_S = 10.0, 3.0
"""Of the free camera: hardly a limit, as in the paper."""

_ERROR_STEPS = 5
"""Of the odometry's errors, in a frame."""
_ERROR_SEED = 20
"""Errors are the same for every method and scene: they are compared with each other."""


def bench_config(depth: DepthChoice, response_s: float = 0.0) -> ServoConfig:
    """Settings of the product on a free camera.

    It answers at once, so nothing is predicted, unless ``response_s`` says that it is late;
    nothing limits its speed, as in the paper; and the gain is 0.1 a frame throughout, the
    paper's for its depth network.
    """
    return ServoConfig(
        depth=depth,
        gain_far=1.0,
        gain_near=1.0,
        response_s=response_s,
        max_horizontal_m_s=MAX_SPEED_M_S,
        max_turn_rad_s=MAX_TURN_RAD_S,
    )


class LateDrive:
    """A camera that answers as late as a PX4 vehicle: a dead time, then a lag of first order.

    A step of the vehicle's forward velocity reaches 10 % after 0.27 s and 63 % after 0.95 s, one
    of its yaw rate after 0.16 s and 0.47 s; here all six components are as late as the former.
    """

    DELAY_FRAMES = 2
    LAG_S = 0.7
    RESPONSE_S = DELAY_FRAMES * FRAME_PERIOD_S + LAG_S

    def __init__(self) -> None:
        self._asked = deque([np.zeros(6)] * self.DELAY_FRAMES)
        self._twist: FloatArray = np.zeros(6)

    def __call__(self, twist: FloatArray) -> FloatArray:
        """Mean twist (6,) over the next frame period."""
        self._asked.append(twist)
        target = self._asked.popleft()
        share = 1.0 - math.exp(-FRAME_PERIOD_S / self.LAG_S)
        before = self._twist
        self._twist = before + share * (target - before)
        mean: FloatArray = 0.5 * (before + self._twist)
        return mean


class Odometry:
    """What a vehicle's estimate says of the free camera's motion, with errors of a grade."""

    def __init__(self, grade: EstimateGrade) -> None:
        self._errors = ErrorProcess(errors_of(grade), np.random.default_rng(_ERROR_SEED))
        self._last_position_m: FloatArray | None = None

    @property
    def velocity_error_m_s(self) -> FloatArray:
        """Estimated minus true velocity (3,), in the world.

        A camera that is controlled by the estimate moves by as much less than it was asked to.
        """
        return np.array(self._errors.velocity_m_s)

    def estimate(self, T_world_camera: FloatArray, t_ns: int) -> Motion:
        """Advance by one frame to a true pose (4, 4); the camera is the body."""
        for _ in range(_ERROR_STEPS):
            self._errors.step(FRAME_PERIOD_S / _ERROR_STEPS)
        position_m = T_world_camera[:3, 3]
        last_m = position_m if self._last_position_m is None else self._last_position_m
        self._last_position_m = position_m
        turn = so3_exp(np.array(self._errors.attitude_rad))
        T = make_pose(turn @ T_world_camera[:3, :3], position_m + np.array(self._errors.position_m))
        velocity_m_s = (position_m - last_m) / FRAME_PERIOD_S + self.velocity_error_m_s
        return Motion.from_pose(T, velocity_m_s, t_ns=t_ns)


@dataclass(frozen=True, slots=True)
class ControlledCamera:
    """How a camera follows."""

    drive: Callable[[FloatArray], FloatArray] = lambda twist: twist
    """Takes the twist (6,) that was asked for and gives the one that the camera makes of it."""
    grade: EstimateGrade = EstimateGrade.PERFECT
    """Errors of the odometry, which the camera is controlled by."""


_EXACT = ControlledCamera()


class PipelineMethod:
    """Runs the product's perception on the benchmark's frames, as the service does on live ones.

    Of the goal only image and intrinsics are used. True depth is handed over for
    ``depth = "given"`` alone, and ``network`` is for ``"network"`` and ``"fused"``.
    """

    def __init__(
        self,
        config: ServoConfig,
        goal: GoalObservation,
        matcher: Matcher,
        network: DepthEstimator | None = None,
        camera: ControlledCamera = _EXACT,
    ) -> None:
        self._drive = camera.drive
        self._odometry = Odometry(camera.grade)
        sidecar = GoalSidecar(goal.camera)
        self._task = ServoTask(config, goal.camera, sidecar)
        self._now_ns = 0
        self._pipeline = Pipeline(
            self._task, matcher, Goal(goal.image, sidecar), lambda: self._now_ns, network
        )
        self._refused = 0
        self.is_false_goal = False
        """Whether the last frame should have been at the goal, and does not look like it."""

    def decide(self, observation: Observation) -> Decision:
        """Process one frame; a refused frame keeps the camera where it is."""
        self._now_ns = (observation.index + 1) * _PERIOD_NS
        depth = observation.depth if self._task.config.depth == "given" else None
        frame = Frame(observation.image, self._now_ns, observation.index)
        motion = self._odometry.estimate(observation.T_world_camera, self._now_ns)
        result = self._pipeline.process_frame(frame, motion, True, depth).result
        self._pipeline.work_between_frames()
        flown = result.status is Status.OK
        self.is_false_goal = result.status is Status.FALSE_GOAL
        self._refused = 0 if flown else self._refused + 1
        given_up = result.status is Status.STUCK or self._refused >= _REFUSALS
        return Decision(
            T_current_next=se3_exp(self._flown(observation, result.velocity) * FRAME_PERIOD_S),
            error=result.median_error_px,
            done=result.reached,
            lost=result.status.value if given_up else "",
        )

    def _flown(self, observation: Observation, asked: FloatArray) -> FloatArray:
        """Twist (6,) that the camera truly makes of the one that it is asked for."""
        twist = self._drive(asked).copy()
        twist[:3] -= observation.T_world_camera[:3, :3].T @ self._odometry.velocity_error_m_s
        return twist
