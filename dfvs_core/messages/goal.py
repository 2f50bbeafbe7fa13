"""Goal image with its sidecar: intrinsics, pose and mounting.

``goal.png`` has ``goal.json`` beside it: the camera's intrinsics, the vehicle's roll and pitch
and the camera's mounting at that moment. Without a sidecar the goal counts as taken level, by
the camera that flies.
"""

from __future__ import annotations

import json
from dataclasses import dataclass, field

import numpy as np

from dfvs_core.errors import ConfigError
from dfvs_core.geometry.arrays import FloatArray, ImageArray
from dfvs_core.geometry.camera import CameraModel
from dfvs_core.geometry.poses import R_BODY_FORWARD_CAMERA, make_pose, rotation_from_euler, so3_log
from dfvs_core.messages.schema import dump, parse, setting, to_text

GOAL_FORMAT = "dfvs-goal/1"
_TURN_RAD = 2.0 * np.pi
_SAME_MOUNT_RAD = np.radians(0.5)
"""Angle between two mountings that are of the same camera."""


@dataclass(frozen=True, slots=True)
class Mount:
    """How the camera sits on the vehicle.

    The angles turn a camera that looks straight ahead (aerospace angles in the body frame). The
    position is in FRD, in m.

    Raises
    ------
    ConfigError
        If an angle is more than a turn.

    Examples
    --------
    >>> downwards = Mount(x_m=0.1, pitch_rad=-np.pi / 2)
    >>> T_body_camera = downwards.T_body_camera()
    >>> (T_body_camera[:3, :3] @ [0.0, 0.0, 1.0]).round(6).tolist()  # its view direction, FRD
    [0.0, 0.0, 1.0]
    """

    x_m: float = setting(0.0, "position of the lens: forward of the vehicle's centre, m")
    y_m: float = setting(0.0, "the same: to the right, m")
    z_m: float = setting(0.0, "the same: down, m")
    roll_rad: float = setting(0.0, "the camera's roll about its line of sight; positive: clockwise")
    pitch_rad: float = setting(0.0, "its pitch; positive: looks up")
    yaw_rad: float = setting(0.0, "its yaw; positive: looks to the right")

    def __post_init__(self) -> None:
        """Refuse angles that are degrees."""
        _require_radians(
            "a mount", _TURN_RAD, roll=self.roll_rad, pitch=self.pitch_rad, yaw=self.yaw_rad
        )

    def T_body_camera(self) -> FloatArray:
        """Pose (4, 4) of the optical frame in the body frame."""
        turn = rotation_from_euler(self.roll_rad, self.pitch_rad, self.yaw_rad)
        position = np.array([self.x_m, self.y_m, self.z_m])
        return make_pose(turn @ R_BODY_FORWARD_CAMERA, position)


@dataclass(frozen=True, slots=True)
class GoalSidecar:
    """How a goal image was taken.

    ``pose_camera`` (16 numbers, row by row) is the pose of the camera in the scene where that is
    known, as in simulation: it serves evaluation only and is never used to fly. ``taken_at`` is
    a date and time for people (ISO 8601).

    Raises
    ------
    ConfigError
        If the format is another one, roll or pitch is above a quarter turn, or the pose is half.
    """

    camera: CameraModel
    roll_rad: float = 0.0
    pitch_rad: float = 0.0
    mount: Mount = field(default_factory=Mount)
    pose_camera: tuple[float, ...] | None = None
    format: str = GOAL_FORMAT
    taken_at: str | None = None

    def __post_init__(self) -> None:
        """Refuse a sidecar of another format, with angles in degrees, or with half a pose."""
        if self.format != GOAL_FORMAT:
            raise ConfigError(f"goal sidecar has format {self.format!r}", repr(GOAL_FORMAT))
        _require_radians("a goal", np.pi / 2, roll=self.roll_rad, pitch=self.pitch_rad)
        if self.pose_camera is not None and len(self.pose_camera) != 16:
            raise ConfigError(f"pose_camera has {len(self.pose_camera)} numbers", "16")

    def to_json(self) -> str:
        """Text of the sidecar file."""
        return to_text(self)

    @classmethod
    def from_json(cls, text: str, flown: GoalSidecar | None = None) -> GoalSidecar:
        """Read a sidecar file's text; one without a camera is of ``flown``'s camera and mount.

        Raises
        ------
        ConfigError
            If it is not JSON or does not follow the schema.
        """
        try:
            data = json.loads(text)
        except json.JSONDecodeError as error:
            raise ConfigError(f"the goal sidecar is not JSON ({error})") from error
        if flown is not None and isinstance(data, dict) and "camera" not in data:
            data = {"camera": dump(flown.camera), "mount": dump(flown.mount)} | data
        return parse(cls, data)


@dataclass(frozen=True, slots=True)
class Goal:
    """A goal image (H, W, 3) uint8 RGB and how it was taken."""

    image: ImageArray
    sidecar: GoalSidecar


def _require_radians(owner: str, most_rad: float, **angles_rad: float) -> None:
    for name, angle_rad in angles_rad.items():
        if not abs(angle_rad) <= most_rad:
            raise ConfigError(
                f"{name} of {owner} is {angle_rad:g} rad ({np.degrees(angle_rad):g} degrees)",
                f"{most_rad:.3g} rad ({np.degrees(most_rad):g} degrees) at most",
                "angles of a Mount and of a goal's JSON are in rad",
            )


def mount_difference(flown: Mount, taken: Mount) -> str:
    """Say how the camera's direction differs between two mountings, both of which are used."""
    R_taken_flown = taken.T_body_camera()[:3, :3].T @ flown.T_body_camera()[:3, :3]
    if np.linalg.norm(so3_log(R_taken_flown)) <= _SAME_MOUNT_RAD:
        return ""
    return (
        f"the goal counts as taken at {_angles(taken)} (its sidecar's mount), the camera flies at "
        f"{_angles(flown)} (camera.mount)"
    )


def _angles(mount: Mount) -> str:
    angles = np.degrees([mount.roll_rad, mount.pitch_rad, mount.yaw_rad])
    return "roll {:.1f}, pitch {:.1f}, yaw {:.1f} deg".format(*angles)
