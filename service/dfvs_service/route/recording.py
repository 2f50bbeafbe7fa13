"""Route recording from frames to goals, without sockets or threads."""

import dataclasses
import enum
import math
import os
from collections.abc import Sequence
from pathlib import Path

from dfvs_common.goal_file import write_goal
from dfvs_core.errors import ConfigError
from dfvs_core.geometry.camera import CameraModel
from dfvs_core.matching.matcher import Matcher
from dfvs_core.messages.frame import Frame
from dfvs_core.messages.goal import Goal, Mount
from dfvs_core.messages.link import GateStatus, VehicleState
from dfvs_core.perception.frame_validator import Expected, GuardState, admit
from dfvs_core.perception.route import KeyframeDecision, RouteRecordingLimits, evaluate
from dfvs_core.perception.vehicle_history import VehicleHistory
from dfvs_core.servo.config import BY_NETWORK
from dfvs_service.frames import RawSample
from dfvs_service.perception.assembly import Clocks, build_frame_processor, servo_task
from dfvs_service.perception.frame_processor import UNKNOWN_ATTITUDE, FrameProcessor
from dfvs_service.settings.config import ServiceConfig
from dfvs_service.settings.goal_file import is_image, sidecar_of

_ROUTE_RECORDING = "ROUTE_RECORDING"
"""Not a state of the gate: the vehicle follows its pilot, and no progress is asked for."""

_LEAST_HEIGHT_M = 0.5
"""Above the last place on the ground: a route's goals do not lead down to it."""


class Event(enum.Enum):
    """What a frame led to."""

    NOTHING = "nothing"
    SAVED = "saved"
    LOST = "lost"


class RouteRecorder:
    """Saves a goal whenever the last one leaves the view.

    ``config`` holds the camera's intrinsics. ``folder`` takes the goals: 001.png, 001.json and so
    on. ``matcher`` is the one that is to fly the route later.
    """

    def __init__(
        self,
        config: ServiceConfig,
        folder: Path,
        matcher: Matcher,
        clocks: Clocks,
        limits: RouteRecordingLimits,
    ) -> None:
        self._config = config
        self._folder = folder
        self._matcher = matcher
        self._clocks = clocks
        self._limits = limits
        self._history = VehicleHistory()
        self._frame_processor: FrameProcessor | None = None
        self._last: Goal | None = None
        self._full_overlap = 0.0
        self._validator_state = GuardState()
        self._ground_down_m = math.inf
        self._height_m = math.inf
        self.count = 0
        self.refusal = ""
        """Why the last frame was not used, empty where it was."""

    def on_vehicle_states(self, states: Sequence[VehicleState], *, on_ground: bool | None) -> None:
        """Update by states of the vehicle, and by whether it stands on the ground, if known."""
        for state in states:
            self._history.add(state)
            down_m = state.position_m[2]
            if on_ground:
                self._ground_down_m = down_m
            self._height_m = 0.0 if on_ground is None else self._ground_down_m - down_m
            if self._frame_processor is not None:
                self._frame_processor.on_gate_status(GateStatus(_ROUTE_RECORDING, "", state))

    def process(self, sample: RawSample) -> Event:
        """Work on one frame."""
        self.refusal = ""
        if self._height_m < _LEAST_HEIGHT_M:
            self.refusal = f"the vehicle is not known to fly {_LEAST_HEIGHT_M} m above the ground"
            return Event.NOTHING
        if self._frame_processor is None:
            return self._process_first(sample)
        processed = self._frame_processor.process(sample)
        if processed.frame is None or processed.frame_result is None:
            self.refusal = processed.report.reason
            return Event.NOTHING
        if processed.frame_result.is_coasting:
            return Event.NOTHING
        result = processed.frame_result.result
        self._full_overlap = max(self._full_overlap, result.overlap)
        decision = evaluate(result, self._limits, self._full_overlap)
        if decision is KeyframeDecision.LOST:
            return Event.LOST
        self._last = self._goal_of(processed.frame)
        return self._save_last() if decision is KeyframeDecision.DUE else Event.NOTHING

    def _process_first(self, sample: RawSample) -> Event:
        """Save the first frame that is as right as all others have to be."""
        camera, clocks = self._config.camera.model(), self._clocks
        if camera is None:
            raise ConfigError("the camera's lens is not known", "a calibration in the settings")
        admission = admit(
            self._validator_state,
            sample.payload,
            sample.attachment,
            Expected(camera, clocks.identity),
            clocks.validation(),
        )
        self._validator_state, frame = admission.state, admission.frame
        if frame is None:
            self.refusal = admission.reason
            return Event.NOTHING
        self._last = self._goal_of(frame)
        self.refusal = UNKNOWN_ATTITUDE if self._last is None else ""
        return self._save_last()

    def finish(self) -> bool:
        """Save the last view in which the route was not lost; returns whether there was one."""
        return self._save_last() is Event.SAVED

    def _goal_of(self, frame: Frame) -> Goal | None:
        """Goal from a frame, None where the vehicle's attitude then is not known."""
        motion = self._history.at(frame.t_capture_ns)
        camera = self._config.camera.model()
        if motion is None or camera is None:
            return None
        return Goal(frame.image, sidecar_of(camera, self._config.camera.mount or Mount(), motion))

    def _save_last(self) -> Event:
        """Save the last view as the next goal, where there is one."""
        goal = self._last
        if goal is None:
            return Event.NOTHING
        self.count += 1
        write_goal(self._folder / f"{self.count:03d}.png", goal.image, goal.sidecar)
        if self._frame_processor is None:
            self._frame_processor = build_frame_processor(
                self._config, goal, self._matcher, self._clocks
            )
        else:
            pipeline = self._frame_processor.pipeline
            pipeline.set_goal(servo_task(self._config, goal), pipeline.prepare(goal))
        self._last, self._full_overlap = None, 0.0
        return Event.SAVED


def prepare_route_folder(folder: Path) -> None:
    """Make the folder of a route.

    Raises
    ------
    ConfigError
        If it cannot be made or written, or holds images already.
    """
    try:
        folder.mkdir(parents=True, exist_ok=True)
        is_empty = not any(is_image(path) for path in folder.iterdir())
    except OSError as error:
        raise ConfigError(f"cannot make the folder {folder} ({error.strerror})") from error
    if not os.access(folder, os.W_OK | os.X_OK):
        raise ConfigError(f"{folder} cannot be written", "a folder that is writable")
    if not is_empty:
        raise ConfigError(f"{folder} holds images already", "an empty folder for the new route")


def route_recording_settings(config: ServiceConfig, camera: CameraModel) -> ServiceConfig:
    """Settings with the camera's intrinsics filled in, and without a depth network."""
    servo = config.servo
    if servo.depth in BY_NETWORK:
        servo = dataclasses.replace(servo, depth="motion")
    return dataclasses.replace(config, camera=config.camera.with_model(camera), servo=servo)
