"""Settings of the service: radians inside, degrees in TOML and on the command line."""

from __future__ import annotations

import dataclasses
import json
import tomllib
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from dfvs_core.errors import ConfigError
from dfvs_core.gate.config import GateConfig, GateTiming, OnDone, S
from dfvs_core.gate.limits import VelocityLimits
from dfvs_core.geometry.camera import CameraModel
from dfvs_core.messages.goal import GoalSidecar, Mount
from dfvs_core.messages.schema import dump, in_degrees, parse, to_text
from dfvs_core.servo.config import ServoConfig
from dfvs_service.settings.camera_section import CameraSection
from dfvs_service.settings.record_sections import BlackBoxSection, RecordSection, TelemetrySection
from dfvs_service.settings.sections import (
    DepthSection,
    FlowSection,
    GateSection,
    LimitsSection,
    RouteSection,
    VehicleSection,
    ZenohSection,
)

_BRAKING_S = {"horizontal": 1.3, "vertical": 2.0}
"""Speed over slew limit up to which the servo law begins to brake early enough for the goal."""

_MOST_SILENCE_S = 0.2
"""A camera that is silent for longer is reported to the gate before its last frame is too old."""


@dataclass(frozen=True, slots=True)
class ServiceConfig:
    """All settings; angles in rad, everything else as the names say."""

    vehicle: VehicleSection = field(default_factory=VehicleSection)
    camera: CameraSection = field(default_factory=CameraSection)
    zenoh: ZenohSection = field(default_factory=ZenohSection)
    flow: FlowSection = field(default_factory=FlowSection)
    depth: DepthSection = field(default_factory=DepthSection)
    servo: ServoConfig = field(default_factory=ServoConfig)
    limits: LimitsSection = field(default_factory=LimitsSection)
    gate: GateSection = field(default_factory=GateSection)
    route: RouteSection = field(default_factory=RouteSection)
    telemetry: TelemetrySection = field(default_factory=TelemetrySection)
    record: RecordSection = field(default_factory=RecordSection)
    black_box: BlackBoxSection = field(default_factory=BlackBoxSection)

    def __post_init__(self) -> None:
        """Refuse what a flight has no source for, and what contradicts itself."""
        if self.servo.depth == "given":
            raise ConfigError(
                "servo.depth = 'given' needs depth with every frame, which no camera sends",
                "'motion', 'network', 'fused', 'flow' or 'constant'",
            )
        slew_m_s2 = self.limits.slew_m_s2
        for axis, most_s in _BRAKING_S.items():
            limit, asked = f"{axis}_m_s", f"max_{axis}_m_s"
            speed_m_s = min(getattr(self.limits, limit), getattr(self.servo, asked))
            if speed_m_s > most_s * slew_m_s2:
                raise ConfigError(
                    f"limits.slew_m_s2 = {slew_m_s2:g} brakes {speed_m_s:g} m/s ({axis}) too late: "
                    "the vehicle would fly beyond the goal",
                    f"at least {speed_m_s / most_s:.3g} m/s² at this speed",
                    f"raise limits.slew_m_s2, or lower limits.{limit} or servo.{asked}",
                )

    @property
    def silence_s(self) -> float:
        """Time without a frame after which the camera is silent: one frame may be missing."""
        return min(2.0 / self.gate.min_frame_hz, _MOST_SILENCE_S)

    def gate_config(self) -> GateConfig:
        """Settings of the gate's core."""
        limits, gate = self.limits, self.gate
        velocity = VelocityLimits(
            limits.horizontal_m_s,
            limits.vertical_m_s,
            limits.yaw_rad_s,
            limits.slew_m_s2,
            limits.yaw_slew_rad_s2,
        )
        timing = dataclasses.replace(
            GateTiming(),
            hold_ns=round(gate.hold_s * S),
            reached_ns=round(gate.reached_s * S),
            response_ns=round(gate.response_s * S),
        )
        return GateConfig(
            velocity=velocity,
            reduced_speed_m_s=gate.reduced_speed_m_s,
            max_distance_m=limits.max_distance_m,
            max_engaged_ns=round(limits.max_engaged_s * S),
            hold_visual_ns=round(gate.hold_visual_s * S),
            min_overlap=gate.min_overlap,
            min_frame_hz=gate.min_frame_hz,
            min_battery=gate.min_battery,
            max_jump_m=gate.max_jump_m,
            engage=gate.engage,
            on_done=OnDone.HOLD if gate.exit_when_done else gate.on_done,
            timing=timing,
        )

    def with_camera(
        self, size: tuple[int, int], sidecar: GoalSidecar | None
    ) -> tuple[ServiceConfig, CameraModel]:
        """Fill in what the settings do not say of the camera; return its model as well.

        ``size`` (width, height) px of the goal image is taken where none is set; intrinsics and
        mounting are the sidecar's where none are set.

        Raises
        ------
        ConfigError
            If no intrinsics are known.
        """
        camera = dataclasses.replace(
            self.camera, width=self.camera.width or size[0], height=self.camera.height or size[1]
        )
        model = camera.model() or (None if sidecar is None else sidecar.camera)
        if model is None:
            raise ConfigError(
                "nothing is known of the camera's lens",
                "camera.horizontal_fov_deg or fx, fy, cx, cy, or a goal with a sidecar",
                "try --camera-fov DEGREES",
            )
        mount = Mount() if sidecar is None else sidecar.mount
        filled = dataclasses.replace(camera.with_model(model), mount=camera.mount or mount)
        return dataclasses.replace(self, camera=filled), model

    def to_json(self) -> str:
        """Resolved settings as JSON, angles in rad, for the child processes."""
        return to_text(self)


def config_from_json(text: str) -> ServiceConfig:
    """Read what ``ServiceConfig.to_json`` wrote.

    Raises
    ------
    ConfigError
        If the text does not follow the schema.
    """
    return parse(ServiceConfig, json.loads(text))


def load_config(path: Path | None, overrides: Mapping[str, Any]) -> ServiceConfig:
    """Settings from a TOML file and from ``section.key`` overrides, angles in degrees in both.

    Raises
    ------
    ConfigError
        If the file is missing or not TOML, or a key or value is wrong.
    """
    data: dict[str, Any] = {} if path is None else _read_toml(path)
    for dotted, value in overrides.items():
        _put(data, dotted, value)
    # Defaults take the way through a file too, so that the printed settings read back the same.
    return parse(ServiceConfig, _merged(in_degrees(dump(ServiceConfig())), data), file=True)


def _merged(defaults: dict[str, Any], data: Mapping[str, Any]) -> dict[str, Any]:
    result = dict(defaults)
    for key, value in data.items():
        default = defaults.get(key)
        both = isinstance(default, dict) and isinstance(value, dict)
        result[key] = _merged(default or {}, value) if both else value
    return result


def _read_toml(path: Path) -> dict[str, Any]:
    try:
        return tomllib.loads(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise ConfigError(f"cannot read {path} ({error.strerror})", "a TOML file") from error
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
        raise ConfigError(f"{path} is not TOML ({error})") from error


def _put(data: dict[str, Any], dotted: str, value: object) -> None:
    *sections, key = dotted.split(".")
    if not sections:
        raise ConfigError(f"setting {dotted!r} names no section", "section.key=value")
    for section in sections:
        inner = data.setdefault(section, {})
        if not isinstance(inner, dict):
            raise ConfigError(f"{section!r} of {dotted!r} is a value, not a section")
        data = inner
    data[key] = value


def parse_assignment(text: str) -> tuple[str, Any]:
    """``section.key=value`` of the command line; the value is TOML, or else a bare string.

    Raises
    ------
    ConfigError
        If there is no ``=``.
    """
    dotted, equals, value = text.partition("=")
    if not equals or not dotted.strip():
        raise ConfigError(f"--set {text!r}", "section.key=value")
    try:
        return dotted.strip(), tomllib.loads(f"value = {value}")["value"]
    except tomllib.TOMLDecodeError:
        return dotted.strip(), value.strip()
