"""Conversion of telemetry documents to ROS 2 messages.

ROS counts forward, left, up (REP 103) where we count forward, right, down.
"""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from dfvs_common.ros2 import header, make

TWIST = "geometry_msgs/msg/TwistStamped"
DIAGNOSTICS = "diagnostic_msgs/msg/DiagnosticArray"
IMAGE = "sensor_msgs/msg/CompressedImage"

BODY, CAMERA = "base_link", "camera_optical"
_OK, _WARN, _ERROR = 0, 1, 2
_LEVELS = {"READY": _OK, "ENGAGE": _OK, "SERVO": _OK, "DONE": _OK, "ABORT": _ERROR}
_SERVO_VALUES = (
    "error_m",
    "error_spread_m",
    "mean_error_m",
    "mean_error_spread_m",
    "error_rad",
    "overlap",
    "inlier_share",
    "depth_m",
    "scale_spread",
    "odometry_error_m_s",
    "mounting_score",
    "condition",
)
_VELOCITY_ERROR = {"forward": 1.0, "left": -1.0, "up": -1.0}
"""Axes of ROS, and their sign in our axes."""


def setpoint_message(state: Mapping[str, Any], stamp_ns: int) -> Any:
    """TwistStamped of the velocity that the gate sent last, in the body's axes."""
    forward, right, down, yaw_rate = (float(value) for value in state["setpoint"])
    linear = make("geometry_msgs/msg/Vector3", forward, -right, -down)
    angular = make("geometry_msgs/msg/Vector3", 0.0, 0.0, -yaw_rate)
    twist = make("geometry_msgs/msg/Twist", linear, angular)
    return make(TWIST, header(stamp_ns, BODY), twist)


def diagnostics_message(
    vehicle: str, state: Mapping[str, Any], servo: Mapping[str, Any] | None, stamp_ns: int
) -> Any:
    """DiagnosticArray of the gate's state with its cause, and of the last frame's figures.

    ``state`` and ``servo`` are the service's documents; ``servo`` is empty where there was none
    yet, and None where it is old. ``stamp_ns`` is wall-clock time.
    """
    name = str(state["state"])
    level = _LEVELS.get(name, _WARN)
    figures = servo or {}
    values = [
        _pair("mode", state.get("mode")),
        _pair("battery", state.get("battery")),
        _pair("distance_m", state.get("distance_m")),
        *(_pair(key, figures.get(key)) for key in _SERVO_VALUES),
        *_velocity_error(figures.get("velocity_error")),
    ]
    message = f"{name}: {state.get('cause', '')}".rstrip(": ")
    if servo is None:
        message += " (no figures of a frame for over 1 s)"
    status = make(
        "diagnostic_msgs/msg/DiagnosticStatus",
        level,
        f"dfvs: {vehicle}",
        message,
        vehicle,
        [value for value in values if value is not None],
    )
    return make(DIAGNOSTICS, header(stamp_ns, ""), [status])


def _velocity_error(velocity: Sequence[float] | None) -> list[Any]:
    """KeyValues of the estimated true-minus-odometry velocity, m/s; none where it is unknown."""
    if velocity is None:
        return []
    return [
        _pair(f"velocity_error_{axis}_m_s", sign * value)
        for (axis, sign), value in zip(_VELOCITY_ERROR.items(), velocity, strict=False)
    ]


def _pair(key: str, value: object) -> Any | None:
    """KeyValue, None where the value is not known."""
    if value is None:
        return None
    text = f"{value:.6g}" if isinstance(value, float) else str(value)
    return make("diagnostic_msgs/msg/KeyValue", key, text)


def preview_message(jpeg: bytes, stamp_ns: int) -> Any:
    """CompressedImage of the preview."""
    return make(IMAGE, header(stamp_ns, CAMERA), "jpeg", np.frombuffer(jpeg, np.uint8))
