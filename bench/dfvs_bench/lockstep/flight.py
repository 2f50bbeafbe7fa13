"""One flight in simulated time, from hover to its end, judged by the true pose."""

import math
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from dfvs_bench.lockstep.vehicle import HoveringVehicle
from dfvs_core.depth.network import DepthEstimator
from dfvs_core.gate.config import Engage, GateConfig, OnDone, S
from dfvs_core.gate.events import Event, Report
from dfvs_core.gate.limits import VelocityLimits
from dfvs_core.gate.machine import GateMachine
from dfvs_core.gate.states import Transition
from dfvs_core.geometry.arrays import FloatArray, ImageArray
from dfvs_core.geometry.camera import CameraModel
from dfvs_core.geometry.poses import invert_pose, make_pose, pose_error, rotation_from_euler
from dfvs_core.matching.matcher import Matcher
from dfvs_core.messages.frame import Frame
from dfvs_core.messages.goal import Goal, GoalSidecar, Mount
from dfvs_core.perception.pipeline import Pipeline
from dfvs_core.perception.vehicle_history import VehicleHistory
from dfvs_core.servo.config import DepthChoice, ServoConfig
from dfvs_core.servo.exchange import ServoResult
from dfvs_core.servo.task import ServoTask
from dfvs_models import DEFAULT_DEPTH
from dfvs_sim.vehicle.motion.flight import VehicleConfig
from dfvs_sim.viewpoints.sampling import Task

EXACT = "exact"
"""Correspondences by the renderer's depth, with noise."""

CAMERA = CameraModel.from_horizontal_fov(320, 240, math.radians(75.0))

_TICK_NS = 20_000_000
_FRAME_PERIOD_NS = round(1e9 / 15.0)
_LATENCY_NS = 60_000_000
"""From the capture of a frame to its report."""
_HOLD_MARGIN_S = 60.0
_ENDED = frozenset({"DONE", "ABORT", "RELEASED"})

Render = Callable[[FloatArray], ImageArray]
"""Image (H, W, 3) from ``T_scene_camera`` (4, 4)."""


@dataclass(frozen=True, slots=True)
class SimulatedJob:
    """One flight of a run; picklable.

    ``matcher`` is ``exact`` or a name that ``dfvs-service`` knows. ``mounted`` is how the camera
    truly sits; the settings say ahead and level. A flight without an end is given
    up ``timeout_s`` after the start; one that has ended is watched for ``hold_s`` more, in which
    the goal is held after DONE. ``limits`` are the gate's, whose horizontal speed the servo law
    takes too. ``depth`` is ``servo.depth``, ``depth_model`` the bundle that it may need. The
    vehicle hovers ``height_m`` above the ground at the start.
    """

    seed: int
    scene: Path
    vehicle: VehicleConfig
    matcher: str = EXACT
    timeout_s: float = 60.0
    hold_s: float = 5.0
    mounted: Mount = field(default_factory=Mount)
    limits: VelocityLimits = field(default_factory=VelocityLimits)
    depth: DepthChoice = "motion"
    depth_model: str = DEFAULT_DEPTH
    height_m: float = 1.5


@dataclass(frozen=True, slots=True)
class Sample:
    """One frame: time since the release to servo, true error and pose, and result."""

    t_s: float
    state: str
    error_m: float
    error_rad: float
    T_scene_camera: FloatArray
    result: ServoResult | None


@dataclass(slots=True)
class LockstepLog:
    """What is known after a flight."""

    samples: list[Sample] = field(default_factory=list)
    transitions: list[Transition] = field(default_factory=list)
    engaged_ns: int | None = None
    ended_s: float | None = None

    @property
    def end(self) -> Transition | None:
        """First transition into a state that ends a flight."""
        return next((t for t in self.transitions if str(t.target) in _ENDED), None)

    @property
    def last_end(self) -> Transition | None:
        """Last one: a goal that is held may still be lost."""
        return next((t for t in reversed(self.transitions) if str(t.target) in _ENDED), None)


class LockstepFlight:
    """Vehicle, camera, perception and gate in one process.

    ``render`` makes the goal image, and each frame before it is encoded; ``depth`` is a network for
    ``servo.depth = "network"`` and ``"fused"``.
    """

    def __init__(
        self,
        job: SimulatedJob,
        task: Task,
        matcher: Matcher,
        render: Render,
        depth: DepthEstimator | None,
    ) -> None:
        self._job, self._task, self._render = job, task, render
        self._vehicle = HoveringVehicle(job.vehicle, np.random.default_rng(job.seed), job.height_m)
        self._T_body_camera = job.mounted.T_body_camera()
        self._T_scene_local = self._anchor()
        sidecar = GoalSidecar(CAMERA)
        servo = ServoConfig(depth=job.depth, max_horizontal_m_s=job.limits.horizontal_m_s)
        goal = Goal(render(task.T_world_goal), sidecar)
        self._now_ns = self._vehicle.now_ns
        self._pipeline = Pipeline(
            ServoTask(servo, CAMERA, sidecar, Mount()), matcher, goal, lambda: self._now_ns, depth
        )
        gate = GateConfig(
            velocity=job.limits,
            engage=Engage.AUTO,
            on_done=OnDone.HOLD_VISUAL,
            hold_visual_ns=round((job.hold_s + _HOLD_MARGIN_S) * S),
        )
        self._gate = GateMachine(gate, self._now_ns)
        self._history = VehicleHistory()
        self._reports: deque[tuple[int, Report]] = deque()
        self._frames = 0
        self._log = LockstepLog()

    def _anchor(self) -> FloatArray:
        """Place the local frame so that the camera hovers at the start, level."""
        T = self._vehicle.T_local_body()
        yaw = np.arctan2(T[1, 0], T[0, 0])
        level = make_pose(rotation_from_euler(0.0, 0.0, yaw), T[:3, 3])
        return self._task.T_world_start @ invert_pose(self._T_body_camera) @ invert_pose(level)

    def run(self) -> LockstepLog:
        """Fly to the end, and watch for ``hold_s`` more."""
        start_ns = self._now_ns
        next_frame_ns, tick = start_ns, 0
        while not self._is_over(start_ns):
            self._vehicle.advance(self._now_ns)
            self._history.add(self._vehicle.state())
            self._step_gate(tick)
            if self._now_ns >= next_frame_ns:
                next_frame_ns += _FRAME_PERIOD_NS
                self._take_frame()
            self._now_ns += _TICK_NS
            tick += 1
        return self._log

    def _is_over(self, start_ns: int) -> bool:
        now_s = (self._now_ns - start_ns) * 1e-9
        if self._log.ended_s is None and self._log.end is not None:
            self._log.ended_s = now_s
        if self._log.ended_s is None:
            return now_s > self._job.timeout_s
        return now_s > self._log.ended_s + self._job.hold_s

    def _step_gate(self, tick: int) -> None:
        events: list[Event] = list(self._vehicle.events(tick))
        while self._reports and self._reports[0][0] <= self._now_ns:
            events.append(self._reports.popleft()[1])
        output = self._gate.step(self._now_ns, events)
        self._log.transitions += output.transitions
        for change in output.transitions:
            if str(change.target) == "SERVO" and self._log.engaged_ns is None:
                self._log.engaged_ns = self._now_ns
        if output.mode_request is not None:
            self._vehicle.request(output.mode_request)
        if output.setpoint is not None:
            self._vehicle.follow(output.setpoint)

    def _take_frame(self) -> None:
        T = self._T_scene_local @ self._vehicle.T_local_body() @ self._T_body_camera
        motion = self._history.at(self._now_ns)
        result = None
        if motion is not None:
            frame = Frame(self._render(T), self._now_ns, self._frames)
            self._frames += 1
            state = str(self._gate.state)
            outcome = self._pipeline.process_frame(
                frame, motion, engaged=state == "SERVO", paused=state == "HOLD"
            )
            arrival_ns = self._now_ns + _LATENCY_NS
            if not outcome.is_coasting:
                self._reports.append((arrival_ns, Report(arrival_ns, outcome.report)))
            result = outcome.result
            self._pipeline.work_between_frames()
        since_s = (self._now_ns - (self._log.engaged_ns or self._now_ns)) * 1e-9
        error = pose_error(T, self._task.T_world_goal)
        self._log.samples.append(Sample(since_s, str(self._gate.state), *error, T, result))
