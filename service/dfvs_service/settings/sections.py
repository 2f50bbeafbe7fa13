"""Settings sections of vehicle, link, perception, gate and route; angles in rad."""

import math
from dataclasses import dataclass
from typing import Literal

from dfvs_core.errors import ConfigError
from dfvs_core.gate.config import Engage, GateConfig, OnDone, S
from dfvs_core.gate.limits import VelocityLimits
from dfvs_core.messages.schema import setting
from dfvs_core.messages.topics import Topics
from dfvs_core.messages.zenoh_settings import TlsFiles, is_encrypted
from dfvs_models import DEFAULT_DEPTH, DEFAULT_MATCHER
from dfvs_service.settings.endpoints import here, is_private
from dfvs_service.settings.mavlink_url import MavlinkUrl

_WORKING_WIDTHS_PX = (64, 1920)
_VELOCITY = VelocityLimits()
_GATE = GateConfig()


@dataclass(frozen=True, slots=True)
class VehicleSection:
    """The vehicle and the way to its autopilot."""

    name: str = setting("drone1", "name of the vehicle, part of every Zenoh key")
    mavlink: str = setting(
        "udpin://127.0.0.1:14540", "MAVLink connection, e.g. serial:///dev/ttyACM0:921600"
    )
    system_id: int = setting(
        0,
        "MAVLink system id of the autopilot (MAV_SYS_ID); 0: the only autopilot on the connection",
        low=0,
        high=250,
    )
    timeout_s: float = setting(
        10.0, "give up if no autopilot is heard for so long, s", low=1.0, high=600.0
    )

    def __post_init__(self) -> None:
        """Refuse a name that no Zenoh key can hold, and a connection that MAVSDK does not take."""
        Topics(self.name)
        MavlinkUrl.parse(self.mavlink)


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
        """Refuse malformed or exposed endpoints, and a client without a router."""
        if self.mode == "client" and not self.connect:
            raise ConfigError("zenoh.mode = 'client' without zenoh.connect", "a router's endpoint")
        for endpoint in (*self.connect, *self.listen):
            if "/" not in endpoint:
                raise ConfigError(
                    f"zenoh endpoint {endpoint!r}", "PROTOCOL/HOST:PORT, such as tcp/127.0.0.1:7447"
                )
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

    @property
    def reached_at(self) -> tuple[str, ...]:
        """Endpoints at which other programs reach the service: its router's, or its own."""
        return self.connect if self.mode == "client" else tuple(map(here, self.listen))


@dataclass(frozen=True, slots=True)
class FlowSection:
    """Where correspondences come from."""

    model: str = setting(
        DEFAULT_MATCHER,
        "a shipped bundle's name, a bundle's folder, 'hybrid:' and a pair bundle, or 'classical'",
    )
    threads: int = setting(2, "threads for the network", low=1, high=64)
    provider: str = setting("CPUExecutionProvider", "ONNX Runtime's execution provider")
    working_width_px: int = setting(
        0,
        "width at which images of 4:3 are matched, others at as many pixels, px; 0: the largest "
        "that tracking_ms allows, measured at start (0, or 64 to 1920)",
    )
    tracking_ms: float = setting(
        25.0, "time of a tracked frame that the working size is chosen by, ms", low=1, high=125
    )

    def __post_init__(self) -> None:
        """Refuse a size at which nothing can be matched."""
        low, high = _WORKING_WIDTHS_PX
        if self.working_width_px != 0 and not low <= self.working_width_px <= high:
            raise ConfigError(
                f"flow.working_width_px = {self.working_width_px}", f"0, or {low} to {high}"
            )


@dataclass(frozen=True, slots=True)
class DepthSection:
    """Where depth by a network comes from; threads and provider are those of the flow network."""

    model: str = setting(
        DEFAULT_DEPTH,
        "a shipped bundle's name or a bundle's folder, for servo.depth = 'network' and 'fused'",
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
        _GATE.min_overlap, "share of the view that must be matched to start", low=0.0, high=1.0
    )
    min_frame_hz: float = setting(
        _GATE.min_frame_hz,
        "good frames a second that are needed to start; a camera that is silent for two periods "
        "of it, or 0.2 s, stops the vehicle; a result counts for 200 ms, so fewer cannot be flown; "
        "the period of the frames and the delay of the results must not exceed 250 ms together",
        low=S / _GATE.timing.result_age_ns,
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
