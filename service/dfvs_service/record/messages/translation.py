"""Conversion of session headers and frame records to messages of a recording.

``/dfvs/turn`` with the image of the same sequence number holds all that a replay needs. The
other channels say the same in Foxglove's standard schemas and as plain JSON, for people.
"""

import json
import math
from collections.abc import Iterator
from typing import Any

from dfvs_core.errors import WireError
from dfvs_core.gate.states import GateState
from dfvs_core.messages.frame import PixelFormat, decode_header
from dfvs_core.messages.frame_record import FrameInput, FrameRecord, SessionHeader
from dfvs_core.messages.goal import GoalSidecar, Mount
from dfvs_core.messages.link import GateStatus, PerceptionReport, VehicleState
from dfvs_core.messages.schema import dump, parse, to_json
from dfvs_core.perception.flow_grid import FlowGrid
from dfvs_service.pace import Pace
from dfvs_service.record.messages import channels, foxglove
from dfvs_service.record.messages.channels import Channel, Message, json_channel
from dfvs_service.settings.camera_section import CameraSection

_NO_VEHICLE = VehicleState(0, 0.0, 0.0, 0.0, (0.0, 0.0, 0.0), (0.0, 0.0, 0.0))
_NO_REPORT = PerceptionReport(0, 0, (0.0,) * 4, False, False, False, "", 0.0, 0.0, 0.0, 0.0)

STATE = json_channel("/gate/state", "dfvs.GateStatus", dump(GateStatus("", "", _NO_VEHICLE)))
_SETPOINT_NAMES = ("forward_m_s", "right_m_s", "down_m_s", "yaw_rad_s")
SETPOINT = json_channel("/gate/setpoint", "dfvs.Setpoint", dict.fromkeys(_SETPOINT_NAMES, 0.0))
REPORT = json_channel("/perception/report", "dfvs.PerceptionReport", dump(_NO_REPORT))
_COMPRESSED = {PixelFormat.JPEG: "jpeg", PixelFormat.PNG: "png"}
_PATH_HZ = 1.0

_SERVO_VECTORS = ("velocity_error",)
"""Arrays in a servo document that are null where they are unknown."""

_SPACING_M = 0.05
_MOST_POINTS = 1000

Position = tuple[float, float, float]


class FlightLog:
    """Logs changes of state with their cause, answers to commands, and each warning once."""

    def __init__(self) -> None:
        self._last: GateStatus | None = None
        self._warned: set[str] = set()

    def entries(self, status: GateStatus) -> Iterator[foxglove.Entry]:
        """Lines about what changed with this status."""
        last, self._last = self._last, status
        if last is None or (status.state, status.since_ns) != (last.state, last.since_ns):
            text = f"{status.state}: {status.cause}" if status.cause else status.state
            if status.state == GateState.ABORT:
                yield "ERROR", text
            else:
                yield "WARNING" if status.state == GateState.HOLD else "INFO", text
        if last is not None and status.command_count > last.command_count:
            yield "INFO", f"command {status.command_result}"
        for text in status.warnings:
            if text not in self._warned:
                self._warned.add(text)
                yield "WARNING", text


class FlownPath:
    """Positions (m) at least so far apart; when they become too many, every second one goes."""

    def __init__(self) -> None:
        self._spacing_m = _SPACING_M
        self.positions_m: list[Position] = []

    def add(self, position_m: Position) -> bool:
        """Take a position; returns whether it is kept."""
        kept = self.positions_m
        if kept and math.dist(kept[-1], position_m) < self._spacing_m:
            return False
        kept.append(position_m)
        if len(kept) > _MOST_POINTS:
            self.positions_m = kept[::2]
            self._spacing_m *= 2.0
        return True


class Translation:
    """Messages of one session header and of the frame records that follow from it."""

    def __init__(self, header: SessionHeader) -> None:
        self._header = header
        sidecar = parse(GoalSidecar, header.sidecar)
        camera = parse(CameraSection, header.settings["camera"])
        self._camera = camera.model() or sidecar.camera
        self._mount = camera.mount or Mount()
        self._min_confidence = float(header.settings["servo"]["min_confidence"])
        self._servo: Channel | None = None
        self._log = FlightLog()
        self._path, self._path_pace = FlownPath(), Pace.of_rate(_PATH_HZ)
        self._is_path_new = False
        self._last = (header.first_turn, header.opened_ns)

    def header(self, image: bytes, now_unix_ns: int | None = None) -> Iterator[Message]:
        """Settings, goal image (PNG), calibration and the frames that stand still.

        Stamped with the session header's own time, or with another one where they are repeated.
        """
        header = self._header
        t_ns = self._unix(header.opened_ns) if now_unix_ns is None else now_unix_ns
        goal = foxglove.compressed_image(t_ns, "goal", image, "png")
        calibration = foxglove.calibration(t_ns, self._camera)
        transforms = foxglove.still_transforms(t_ns, self._mount)
        for channel, data in (
            (channels.SESSION_HEADER, to_json(header)),
            (channels.GOAL_IMAGE, goal),
            (channels.CALIBRATION, calibration),
            (channels.TRANSFORMS, transforms),
        ):
            yield Message(channel, t_ns, header.first_turn, data)

    def record(self, record: FrameRecord, payload: bytes) -> Iterator[Message]:
        """One frame record with its sample's payload."""
        t_ns = self._unix(record.t_ns)
        self._last = (record.number, record.t_ns)
        yield Message(channels.FRAME_RECORD, t_ns, record.number, to_json(record))
        for status in record.heard:
            yield from self._status(status, record.number)
        yield self._json(REPORT, t_ns, record.number, dump(record.report))
        if record.sight is not None:
            yield self._image(record.sight, payload, t_ns, record.number)
        if record.servo:
            yield self._json(self._servo_channel(record.servo), t_ns, record.number, record.servo)

    def flow(self, grid: FlowGrid) -> Message:
        """Flow of a frame, published after the last frame record."""
        number, t_ns = self._last
        at_ns = self._unix(grid.t_capture_ns)
        data = foxglove.flow_annotations(at_ns, grid, self._min_confidence)
        return Message(channels.FLOW, self._unix(t_ns), number, data)

    def _status(self, status: GateStatus, number: int) -> Iterator[Message]:
        t_ns = self._unix(status.t_ns)
        for entry in self._log.entries(status):
            data = foxglove.log(t_ns, "gate", entry)
            yield Message(channels.GATE_LOG, t_ns, number, data)
        yield self._json(STATE, t_ns, number, dump(status))
        setpoint = dict(zip(_SETPOINT_NAMES, status.setpoint, strict=True))
        yield self._json(SETPOINT, t_ns, number, setpoint)
        vehicle = status.vehicle
        if vehicle is not None:
            at_ns = self._unix(vehicle.t_ns)
            pose = foxglove.pose(at_ns, vehicle)
            yield Message(channels.POSE, t_ns, number, pose)
            transform = foxglove.body_transform(at_ns, vehicle)
            yield Message(channels.TRANSFORMS, t_ns, number, transform)
            self._is_path_new |= self._path.add(vehicle.position_m)
        if self._is_path_new and self._path_pace.due(status.t_ns):
            self._is_path_new = False
            path = foxglove.path(t_ns, self._path.positions_m)
            yield Message(channels.PATH, t_ns, number, path)

    def _image(self, sight: FrameInput, payload: bytes, t_ns: int, number: int) -> Message:
        """Sample as it came; where not even its header can be read, as bare bytes."""
        try:
            header = decode_header(bytes.fromhex(sight.attachment))
        except WireError:
            return Message(channels.UNREADABLE, t_ns, number, payload)
        at_ns = self._unix(header.t_capture_ns)
        compressed = _COMPRESSED.get(header.pixel_format)
        if compressed is None:
            image = foxglove.raw_image(at_ns, payload, header)
            return Message(channels.RAW_IMAGE, t_ns, number, image)
        image = foxglove.compressed_image(at_ns, "camera", payload, compressed)
        return Message(channels.COMPRESSED_IMAGE, t_ns, number, image)

    def _servo_channel(self, document: dict[str, Any]) -> Channel:
        """Channel of the servo documents, its schema made from the first of them."""
        if self._servo is None:
            unknown = {key: [0.0] for key in _SERVO_VECTORS if document.get(key, ()) is None}
            self._servo = json_channel("/perception/servo", "dfvs.Servo", document | unknown)
        return self._servo

    def _json(self, channel: Channel, t_ns: int, number: int, document: object) -> Message:
        return Message(channel, t_ns, number, json.dumps(document, separators=(",", ":")).encode())

    def _unix(self, t_ns: int) -> int:
        """Unix time of a monotonic one; MCAP knows no negative times."""
        return max(t_ns + self._header.unix_offset_ns, 0)
