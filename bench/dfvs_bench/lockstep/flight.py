"""One flight in simulated time, from hover to its end, judged by the true pose."""

from collections import deque
from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np

from dfvs_bench.lockstep.vehicle import HoveringVehicle
from dfvs_core.depth.network import DepthEstimator
from dfvs_core.gate.config import Engage, GateConfig
from dfvs_core.gate.events import Event, Report
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
from dfvs_core.servo.config import ServoConfig
from dfvs_core.servo.exchange import ServoResult
from dfvs_core.servo.task import ServoTask
from dfvs_sim.vehicle.motion.flight import VehicleConfig

_TICK_NS = 20_000_000
_ENDED = frozenset({"DONE", "ABORT", "RELEASED"})

Render = Callable[[FloatArray], ImageArray]
"""Image (H, W, 3) from ``T_scene_camera`` (4, 4)."""


@dataclass(frozen=True, slots=True)
class LockstepSetup:
    """What a flight in simulated time is made of.

    ``latency_s`` is the time from a frame's capture to its report; ``mounted`` is how the camera
    truly sits, where that differs from what the settings say (``mount``). A flight without an end
    is given up ``timeout_s`` after the start; one that has ended is watched for ``after_s`` more.
    """

    camera: CameraModel
    T_scene_start: FloatArray
    T_scene_goal: FloatArray
    vehicle: VehicleConfig = field(default_factory=VehicleConfig)
    servo: ServoConfig = field(default_factory=ServoConfig)
    gate: GateConfig = field(default_factory=lambda: GateConfig(engage=Engage.AUTO))
    mount: Mount = field(default_factory=Mount)
    mounted: Mount | None = None
    rate_hz: float = 15.0
    latency_s: float = 0.06
    timeout_s: float = 90.0
    after_s: float = 1.0
    seed: int = 0
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

    Parameters
    ----------
    setup : LockstepSetup
    matcher : Matcher
    render : callable
    on_pose : callable
        Is told the camera's true pose before each image is encoded.
    depth : DepthEstimator, optional
        For ``servo.depth = "network"`` and ``"fused"``.
    """

    def __init__(
        self,
        setup: LockstepSetup,
        matcher: Matcher,
        render: Render,
        on_pose: Callable[[FloatArray], None] = lambda _: None,
        depth: DepthEstimator | None = None,
    ) -> None:
        self._setup, self._render, self._on_pose = setup, render, on_pose
        rng = np.random.default_rng(setup.seed)
        self._vehicle = HoveringVehicle(setup.vehicle, rng, setup.height_m)
        self._T_scene_local = self._anchor()
        on_pose(setup.T_scene_goal)
        sidecar = GoalSidecar(setup.camera, mount=setup.mount)
        task = ServoTask(setup.servo, setup.camera, sidecar, setup.mount)
        goal = Goal(render(setup.T_scene_goal), sidecar)
        self._now_ns = self._vehicle.now_ns
        self.pipeline = Pipeline(task, matcher, goal, lambda: self._now_ns, depth)
        self._gate = GateMachine(setup.gate, self._now_ns)
        self._history = VehicleHistory()
        self._reports: deque[tuple[int, Report]] = deque()
        self._frames = 0
        self.log = LockstepLog()

    def _anchor(self) -> FloatArray:
        """Place the local frame so that the camera hovers at the start, level."""
        T = self._vehicle.T_local_body()
        yaw = np.arctan2(T[1, 0], T[0, 0])
        level = make_pose(rotation_from_euler(0.0, 0.0, yaw), T[:3, 3])
        T_scene_body = self._setup.T_scene_start @ invert_pose(self._mounted.T_body_camera())
        return T_scene_body @ invert_pose(level)

    def T_scene_camera(self) -> FloatArray:
        """True pose (4, 4) of the camera."""
        return self._T_scene_local @ self._vehicle.T_local_body() @ self._mounted.T_body_camera()

    @property
    def T_scene_goal(self) -> FloatArray:
        """Pose (4, 4) of the goal."""
        return self._setup.T_scene_goal

    @property
    def _mounted(self) -> Mount:
        return self._setup.mounted or self._setup.mount

    def run(self) -> LockstepLog:
        """Fly to the end, and watch for ``after_s`` more."""
        period_ns = round(1e9 / self._setup.rate_hz)
        start_ns = self._now_ns
        next_frame_ns, tick = start_ns, 0
        while not self._is_over(start_ns):
            self._vehicle.advance(self._now_ns)
            self._history.add(self._vehicle.state())
            self._step_gate(tick)
            if self._now_ns >= next_frame_ns:
                next_frame_ns += period_ns
                self._take_frame()
            self._now_ns += _TICK_NS
            tick += 1
        return self.log

    def _is_over(self, start_ns: int) -> bool:
        now_s = (self._now_ns - start_ns) * 1e-9
        if self.log.ended_s is None and self.log.end is not None:
            self.log.ended_s = now_s
        if self.log.ended_s is None:
            return now_s > self._setup.timeout_s
        return now_s > self.log.ended_s + self._setup.after_s

    def _step_gate(self, tick: int) -> None:
        events: list[Event] = list(self._vehicle.events(tick))
        while self._reports and self._reports[0][0] <= self._now_ns:
            events.append(self._reports.popleft()[1])
        output = self._gate.step(self._now_ns, events)
        self.log.transitions += output.transitions
        for change in output.transitions:
            if str(change.target) == "SERVO" and self.log.engaged_ns is None:
                self.log.engaged_ns = self._now_ns
        if output.mode_request is not None:
            self._vehicle.request(output.mode_request)
        if output.setpoint is not None:
            self._vehicle.follow(output.setpoint)

    def _take_frame(self) -> None:
        T = self.T_scene_camera()
        self._on_pose(T)
        motion = self._history.at(self._now_ns)
        result = None
        if motion is not None:
            frame = Frame(self._render(T), self._now_ns, self._frames)
            self._frames += 1
            state = str(self._gate.state)
            outcome = self.pipeline.process_frame(
                frame, motion, engaged=state == "SERVO", paused=state == "HOLD"
            )
            arrival_ns = self._now_ns + round(self._setup.latency_s * 1e9)
            if not outcome.is_coasting:
                self._reports.append((arrival_ns, Report(arrival_ns, outcome.report)))
            result = outcome.result
            self.pipeline.work_between_frames()
        error_m, error_rad = pose_error(T, self._setup.T_scene_goal)
        since_ns = self._now_ns - (self.log.engaged_ns or self._now_ns)
        self.log.samples.append(
            Sample(
                since_ns * 1e-9,
                str(self._gate.state),
                error_m,
                error_rad,
                T,
                result,
            )
        )
