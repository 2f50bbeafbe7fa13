"""Sections of the service's settings: one frozen dataclass each, angles in rad."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Literal

from dfvs_core.errors import ConfigError
from dfvs_core.gate.config import Engage, GateConfig, OnDone, S
from dfvs_core.gate.limits import VelocityLimits
from dfvs_core.geometry.camera import CameraModel
from dfvs_core.messages.goal import Mount
from dfvs_core.messages.schema import setting
from dfvs_core.messages.topics import Topics
from dfvs_core.messages.zenoh_settings import TlsFiles
from dfvs_models import DEFAULT_DEPTH, DEFAULT_MATCHER
from dfvs_service.settings.exposure import is_encrypted, is_private

CameraSource = Literal["dfvs", "ros2-rmw", "ros2-bridge"]

_LEAST_WORKING_WIDTH_PX = 64
_VELOCITY = VelocityLimits()
_GATE = GateConfig()


@dataclass(frozen=True, slots=True)
class VehicleSection:
    """The vehicle and the way to its autopilot."""

    name: str = setting("drone1", "name of the vehicle, part of every Zenoh key")
    mavlink: str = setting(
        "udpin://127.0.0.1:14540", "MAVLink connection, e.g. serial:///dev/ttyACM0:921600"
    )
    timeout_s: float = setting(
        10.0, "give up if no autopilot is heard for so long, s", low=1.0, high=600.0
    )

    def __post_init__(self) -> None:
        """Refuse a name that no Zenoh key can hold."""
        Topics(self.name)


@dataclass(frozen=True, slots=True)
class Ros2CameraSection:
    """A camera of ROS 2, where ``camera.source`` names one of its links."""

    topic: str = setting("camera/image_raw", "image topic, with its namespaces")
    compressed: bool = setting(False, "true: the topic carries CompressedImage, not Image")
    info_topic: str = setting("", "CameraInfo's topic; empty: camera_info beside the image topic")
    domain: int = setting(0, "ROS domain (rmw_zenoh only)", low=0, high=232)


@dataclass(frozen=True, slots=True)
class CameraSection:
    """The camera that flies; what is not set is taken from the goal and its sidecar."""

    source: CameraSource = setting(
        "dfvs",
        "whose frames: dfvs (dfvs-camera), ros2-rmw (rmw_zenoh) or ros2-bridge "
        "(zenoh-bridge-ros2dds)",
    )
    width: int | None = setting(None, "width of the frames, px", low=16, high=8192)
    height: int | None = setting(None, "height of the frames, px", low=16, high=8192)
    horizontal_fov_rad: float | None = setting(
        None, "horizontal field of view of a pinhole camera", low=0.05, high=3.1
    )
    fx: float | None = setting(None, "focal length, px", low=1.0)
    fy: float | None = setting(None, "focal length, px", low=1.0)
    cx: float | None = setting(None, "principal point, px; first pixel's centre is 0.5", low=0.0)
    cy: float | None = setting(None, "principal point, px; first pixel's centre is 0.5", low=0.0)
    distortion: tuple[float, ...] = setting((), "OpenCV's k1, k2, p1, p2[, k3[, k4, k5, k6]]")
    timeout_s: float = setting(
        15.0, "give up if no frame arrives for so long after the start, s", low=1.0, high=600.0
    )
    calibration_file: str = setting(
        "", "file of dfvs-camera calibrate, in place of the intrinsics above; empty: none"
    )
    announced_s: float = setting(
        0.0,
        "wait so long for the camera to announce its calibration where none is known; 0: do not",
        low=0.0,
        high=60.0,
    )
    ros2: Ros2CameraSection = field(default_factory=Ros2CameraSection)
    mount: Mount | None = None

    def model(self) -> CameraModel | None:
        """Camera model of these settings, None where they hold no intrinsics.

        Raises
        ------
        ConfigError
            If intrinsics are given in part, or twice.
        """
        fx, fy, cx, cy = self.fx, self.fy, self.cx, self.cy
        given = sum(value is not None for value in (fx, fy, cx, cy))
        if self.horizontal_fov_rad is None and not given and not self.distortion:
            return None
        if self.width is None or self.height is None:
            raise ConfigError("camera has intrinsics but no size", "camera.width and camera.height")
        if self.horizontal_fov_rad is not None:
            if given or self.distortion:
                raise ConfigError(
                    "camera has both horizontal_fov_deg and other intrinsics", "only one of them"
                )
            return CameraModel.from_horizontal_fov(self.width, self.height, self.horizontal_fov_rad)
        if fx is None or fy is None or cx is None or cy is None:
            raise ConfigError("camera has only some intrinsics", "all of fx, fy, cx, cy")
        return CameraModel(self.width, self.height, fx, fy, cx, cy, self.distortion)


@dataclass(frozen=True, slots=True)
class ZenohSection:
    """Where frames come from and telemetry goes to."""

    mode: Literal["peer", "client"] = setting(
        "peer", "client where a router is used: two peers do not talk through one"
    )
    connect: tuple[str, ...] = setting((), "endpoints to connect to, e.g. tcp/127.0.0.1:7447")
    listen: tuple[str, ...] = setting(("tcp/127.0.0.1:7447",), "endpoints to listen on (peer)")
    allow_plaintext: bool = setting(
        False, "true: allow unencrypted connections beyond this machine (anyone may then listen)"
    )
    tls: TlsFiles | None = None

    def __post_init__(self) -> None:
        """Refuse unencrypted endpoints beyond this machine, and a client without a router."""
        if self.mode == "client" and not self.connect:
            raise ConfigError("zenoh.mode = 'client' without zenoh.connect", "a router's endpoint")
        for endpoint in (*self.connect, *self.listen):
            if self.tls is None and is_encrypted(endpoint):
                raise ConfigError(
                    f"zenoh endpoint {endpoint!r} without certificates",
                    "zenoh.tls.ca, zenoh.tls.certificate and zenoh.tls.key",
                    "dfvs-certs makes them",
                )
        if self.exposed and not self.allow_plaintext:
            raise ConfigError(
                f"zenoh endpoint {self.exposed[0]!r} is unencrypted and leaves this machine",
                "tls/... or a loopback address",
                "set zenoh.allow_plaintext = true to accept that anyone may listen and inject",
            )

    @property
    def exposed(self) -> tuple[str, ...]:
        """Endpoints that are unencrypted and leave this machine."""
        return tuple(e for e in (*self.connect, *self.listen) if not is_private(e))


@dataclass(frozen=True, slots=True)
class FlowSection:
    """Where correspondences come from."""

    model: str = setting(DEFAULT_MATCHER, "'classical' or the folder of a model bundle")
    threads: int = setting(2, "threads for the network", low=1, high=64)
    provider: str = setting("CPUExecutionProvider", "ONNX Runtime's execution provider")
    working_width_px: int = setting(
        0,
        "width at which images of 4:3 are matched, others at as many pixels, px; 0: the largest "
        "that tracking_ms allows, measured at start",
        low=0,
        high=1920,
    )
    tracking_ms: float = setting(
        25.0, "time of a tracked frame that the working size is chosen by, ms", low=1, high=125
    )

    def __post_init__(self) -> None:
        """Refuse a size at which nothing can be matched."""
        if 0 < self.working_width_px < _LEAST_WORKING_WIDTH_PX:
            raise ConfigError(
                f"flow.working_width_px = {self.working_width_px}",
                f"0, or {_LEAST_WORKING_WIDTH_PX} or more",
            )


@dataclass(frozen=True, slots=True)
class DepthSection:
    """Where depth by a network comes from; threads and provider are those of the flow network."""

    model: str = setting(
        DEFAULT_DEPTH, "folder of a depth bundle, for servo.depth = 'network' and 'fused'"
    )


@dataclass(frozen=True, slots=True)
class LimitsSection:
    """What no setpoint ever exceeds, whatever perception asks for."""

    horizontal_m_s: float = setting(
        _VELOCITY.horizontal_m_s, "speed over ground, m/s", low=0.01, high=5.0
    )
    vertical_m_s: float = setting(_VELOCITY.vertical_m_s, "vertical speed", low=0.01, high=3.0)
    yaw_rad_s: float = setting(
        _VELOCITY.yaw_rad_s, "turn rate, per s", low=math.radians(1), high=math.radians(120)
    )
    slew_m_s2: float = setting(_VELOCITY.slew_m_s2, "change of velocity", low=0.05, high=5.0)
    yaw_slew_rad_s2: float = setting(
        _VELOCITY.yaw_slew_rad_s2,
        "change of turn rate",
        low=math.radians(5),
        high=math.radians(720),
    )
    max_distance_m: float = setting(
        _GATE.max_distance_m, "distance from the start that ends the flight", low=0.1, high=1000.0
    )
    max_engaged_s: float = setting(
        _GATE.max_engaged_ns / S, "time engaged that ends the flight, s", low=1.0, high=3600.0
    )


@dataclass(frozen=True, slots=True)
class GateSection:
    """How the gate engages, judges and ends."""

    engage: Engage = setting(Engage.PILOT, "who engages: pilot, auto, command, or never")
    on_done: OnDone = setting(
        OnDone.HOLD_VISUAL,
        "at the goal: zero setpoints, the autopilot's hold, or hold-visual: stay by vision",
    )
    hold_visual_s: float = setting(
        _GATE.hold_visual_ns / S,
        "time for which the goal is held by vision; then the autopilot's hold, s",
        low=1.0,
        high=86400.0,
    )
    exit_when_done: bool = setting(
        False, "true: end the service when the flight is over; at the goal the autopilot holds"
    )
    command_key_file: str = setting("", "key of signed commands (mode 0600); empty: none accepted")
    min_overlap: float = setting(
        _GATE.min_overlap, "share of the view that must show the goal to start", low=0.0, high=1.0
    )
    min_frame_hz: float = setting(
        _GATE.min_frame_hz,
        "good frames a second that are needed to start; a camera that is silent for two periods "
        "of it, or 0.2 s, stops the vehicle",
        low=1.0,
        high=60.0,
    )
    min_battery: float = setting(
        _GATE.min_battery, "share of the charge below which the flight ends", low=0.0, high=1.0
    )
    max_jump_m: float = setting(
        _GATE.max_jump_m, "jump of the position estimate that ends the flight", low=0.05, high=100.0
    )
    hold_s: float = setting(
        _GATE.timing.hold_ns / S, "time in HOLD that ends the flight, s", low=1.0, high=60.0
    )
    reached_s: float = setting(
        _GATE.timing.reached_ns / S, "time in tolerance that counts as reached", low=0.1, high=30.0
    )
    response_s: float = setting(
        _GATE.timing.response_ns / S,
        "least time at reduced speed, until the initial-response check has passed, s; "
        "0: no such check (not advised)",
        low=0.0,
        high=5.0,
        formerly="proof_s",
    )
    reduced_speed_m_s: float = setting(
        _GATE.reduced_speed_m_s,
        "largest speed during that time",
        low=0.02,
        high=0.5,
        formerly="proof_m_s",
    )
    allow_return: bool = setting(
        False,
        "true: fly though PX4 would return to launch where setpoints stop (COM_OBL_RC_ACT 0 to 3)",
    )


@dataclass(frozen=True, slots=True)
class RouteSection:
    """Goals in a row: when one on the way counts as passed."""

    near_m: float = setting(
        0.3, "distance to a goal at which the next one is looked for, m", low=0.02, high=10.0
    )
    near_rad: float = setting(
        math.radians(12), "the same for the angle", low=math.radians(0.5), high=math.radians(90)
    )
    min_overlap: float = setting(
        0.2, "share of the view that must show the next goal", low=0.05, high=1.0
    )


@dataclass(frozen=True, slots=True)
class TelemetrySection:
    """What the service publishes."""

    state_hz: float = setting(10.0, "rate of the state", low=0.1, high=50.0)
    preview_hz: float = setting(5.0, "rate of the preview picture; 0: none", low=0.0, high=30.0)
    preview_quality: int = setting(70, "JPEG quality of the preview", low=1, high=100)
    flow_hz: float = setting(
        10.0, "rate of the flow for the dashboard; 0: none", low=0.0, high=30.0
    )


@dataclass(frozen=True, slots=True)
class RecordSection:
    """Recordings of flights; see docs/how-to/recording.md."""

    folder: str = setting("", "where recordings go; empty: none are made")
    max_file_mb: float = setting(
        1000.0, "size at which the next file of a recording begins, MB", low=1.0, high=100_000.0
    )
    max_total_mb: float = setting(
        20_000.0,
        "size of a recording beyond which its oldest file goes",
        low=2.0,
        high=10_000_000.0,
    )
    min_free_mb: float = setting(
        500.0, "free space that is left on the disk: no more is written", low=0.0, high=1_000_000.0
    )


@dataclass(frozen=True, slots=True)
class BlackBoxSection:
    """Records of every flight, always on; see docs/how-to/recording.md."""

    enabled: bool = setting(True, "false: flights leave no records")
    folder: str = setting(
        "", "where flights go; empty: $STATE_DIRECTORY/flights, or ~/.local/state/dfvs/flights"
    )
    max_flight_mb: float = setting(
        500.0, "largest size of one flight, MB", low=10.0, high=100_000.0
    )
    max_total_mb: float = setting(
        5000.0,
        "size of all flights beyond which the oldest go",
        low=10.0,
        high=10_000_000.0,
    )
    min_free_mb: float = setting(
        200.0, "free space that is left on the disk: no more is written", low=0.0, high=1_000_000.0
    )

    def __post_init__(self) -> None:
        """Refuse a flight that could be larger than all of them."""
        if self.max_flight_mb > self.max_total_mb:
            raise ConfigError(
                f"black_box.max_flight_mb = {self.max_flight_mb:g} is more than "
                f"black_box.max_total_mb = {self.max_total_mb:g}",
                "one flight to be no larger than all flights",
            )
