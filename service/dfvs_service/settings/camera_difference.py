"""Differences between the camera that flies and the one that took a goal."""

import math

import numpy as np

from dfvs_core.geometry.camera import CameraModel
from dfvs_core.geometry.poses import so3_log
from dfvs_core.messages.goal import Mount

_TOLERANCE = 0.02
"""Relative difference of two calibrations that are of the same camera."""
_MOUNT_TOLERANCE_RAD = math.radians(0.5)
"""Angle between two mountings that are of the same camera."""


def calibration_difference(flown: CameraModel, taken: CameraModel) -> str:
    """Say in what two calibrations differ more than two of the same camera would; else empty."""
    if flown.size != taken.size:
        return f"the goal was taken at {taken.width} x {taken.height} px"
    pairs = {
        "focal length": (flown.fx, taken.fx, flown.fx),
        "vertical focal length": (flown.fy, taken.fy, flown.fy),
        "principal point's x": (flown.cx, taken.cx, flown.width),
        "principal point's y": (flown.cy, taken.cy, flown.height),
    }
    for name, (here, there, scale) in pairs.items():
        if abs(here - there) > _TOLERANCE * scale:
            return f"the goal's {name} is {there:.1f} px, here it is {here:.1f}"
    return ""


def mount_difference(flown: Mount, taken: Mount) -> str:
    """Say how the camera's direction differs between two mountings, both of which are used."""
    R_taken_flown = taken.T_body_camera()[:3, :3].T @ flown.T_body_camera()[:3, :3]
    if np.linalg.norm(so3_log(R_taken_flown)) <= _MOUNT_TOLERANCE_RAD:
        return ""
    return (
        f"the goal counts as taken at {_angles(taken)} (its sidecar's mount), the camera flies at "
        f"{_angles(flown)} (camera.mount)"
    )


def _angles(mount: Mount) -> str:
    turn = (mount.roll_rad, mount.pitch_rad, mount.yaw_rad)
    return "roll {:.1f}, pitch {:.1f}, yaw {:.1f} deg".format(*map(math.degrees, turn))
