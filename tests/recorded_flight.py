"""A short flight as perception would tell it to a recorder: real matching, a clock in hand."""

from dataclasses import dataclass

import numpy as np
from textured_wall import Wall, texture, turned

from dfvs_core.geometry.camera import CameraModel
from dfvs_core.messages.frame import Frame, PixelFormat, encode_frame
from dfvs_core.messages.frame_record import FrameRecord, SessionHeader
from dfvs_core.messages.goal import Goal, GoalSidecar
from dfvs_core.messages.image import encode_png
from dfvs_core.messages.link import GateStatus, VehicleState
from dfvs_service.frames import RawSample
from dfvs_service.perception.assembly import (
    Clocks,
    build_frame_processor,
    depth_network,
    flow_matcher,
    servo_task,
)
from dfvs_service.perception.recorder import FrameRecorder
from dfvs_service.perception.telemetry.messages import servo_document
from dfvs_service.record.recorder import Recorder
from dfvs_service.settings.config import load_config
from dfvs_service.settings.record_sections import RecordSection

CAMERA = CameraModel.from_horizontal_fov(320, 240, 1.3)
CLOCK = b"c" * 16
MS = 1_000_000


class RunningClock:
    """Goes on by itself, never twice by the same amount, as a real one does."""

    def __init__(self, rng):
        self.now_ns = 5_000_000 * MS
        self._rng = rng

    def __call__(self):
        self.now_ns += int(self._rng.integers(10_000, 3_000_000))
        return self.now_ns


@dataclass(frozen=True)
class RecordedFlight:
    """``events`` are openings and their turns, each with the bytes beside it."""

    events: list

    @property
    def opening(self):
        return self.events[0][0]

    @property
    def turns(self):
        return [message for message, _ in self.events if isinstance(message, FrameRecord)]


def fly(
    rng, frames=24, pixel_format=PixelFormat.JPEG, next_goal_at=None, preview_of=None, **settings
):
    """Drift towards the goal picture; every seventh turn sees nothing, one sees rubbish.

    ``next_goal_at`` is the frame from which on another goal is looked for. With ``preview_of`` it
    is tracked from the preview of that frame, which is worked out when it is needed.
    """
    sidecar = GoalSidecar(CAMERA)
    overrides = {"vehicle.name": "bottled", "flow.threads": 1, "flow.model": "classical"}
    overrides["flow.working_width_px"] = 160  # half of the camera's: it takes less time
    overrides |= {name.replace("__", "."): value for name, value in settings.items()}
    config, _ = load_config(None, overrides).with_camera((320, 240), sidecar)
    wall = Wall(texture(rng))
    goal = Goal(wall.picture(), sidecar)
    following = Goal(wall.picture(turned(shift=(-20.0, 5.0))), sidecar)
    preview = None
    clock = RunningClock(rng)
    eye = build_frame_processor(
        config, goal, flow_matcher(config.flow), Clocks(CLOCK, clock, clock), depth_network(config)
    )
    book = FrameRecorder(config, CLOCK, clock)
    events = [(book.open(goal), encode_png(goal.image))]
    for i in range(frames):
        if i == next_goal_at:
            observation = None if preview is None else preview().observation
            view = eye.pipeline.prepare(following)
            eye.pipeline.set_goal(servo_task(config, following), view, observation)
            opening = book.open(following, eye.pipeline.observed_ns)
            events.append((opening, encode_png(following.image)))
        heard = [status_at(clock, i, k) for k in range(3)]
        for status in heard:
            eye.on_gate_status(status)
        if i % 7 == 6:
            report = eye.process(RawSample(b"", b"", clock())).report
            events.append((book.without_sample(clock(), heard, report), b""))
            continue
        left_px = 24.0 - i
        picture = wall.picture(turned(shift=(left_px, 0.3 * left_px)))
        noise = rng.integers(-2, 3, picture.shape)
        image = np.clip(picture.astype(int) + noise, 0, 255).astype(np.uint8)
        payload, attachment = encode_frame(Frame(image, clock(), i + 1), pixel_format, CLOCK)
        if i == 4:
            payload, attachment = b"rubbish", b"of any kind"
        sample = RawSample(payload, attachment, clock())
        glance = eye.process(sample)
        outcome = glance.frame_result
        servo = servo_document(glance.frame, outcome, clock(), glance.stages_ns) if outcome else {}
        events.append((book.with_sample(sample, heard, glance, servo), payload))
        eye.pipeline.work_between_frames()
        if i == preview_of:
            view = eye.pipeline.prepare(following)
            preview = eye.pipeline.evaluate_next_goal(servo_task(config, following), view)
    return RecordedFlight(events)


def put(recorder, message, payload):
    """Give a recorder an opening or a turn."""
    take = recorder.open if isinstance(message, SessionHeader) else recorder.add
    take(message, payload)


def write_recording(folder, events):
    """Openings and turns as a recording; its file."""
    recorder = Recorder(folder, "flight", RecordSection(min_free_mb=0.0), lambda: 0, print)
    for event in events:
        put(recorder, *event)
    recorder.close()
    return folder / "flight-000.mcap"


def status_at(clock, i, k):
    """The gate's word, 20 ms after the one before; the vehicle drifts to the right."""
    clock.now_ns += 15 * MS
    t_ns = clock()
    position = (0.0, 0.02 * i + 0.004 * k, -1.5)
    vehicle = VehicleState(t_ns, 0.01, -0.02, 0.3 + 1e-3 * i, (0.02, 0.25, 0.0), position)
    return GateStatus("SERVO", "tested", vehicle, t_ns, setpoint=(0.0, 0.25, 0.0, 0.01))
