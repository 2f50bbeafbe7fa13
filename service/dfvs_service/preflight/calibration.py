"""Check that the flying camera's calibration and mounting agree with the goal's."""

import math
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from dfvs_core.gate.checks.preflight import Check
from dfvs_core.geometry.camera import calibration_difference
from dfvs_core.geometry.poses import so3_log
from dfvs_core.messages.goal import Goal, Mount
from dfvs_service.settings.config import ServiceConfig

_MOUNT_TOLERANCE_RAD = math.radians(0.5)
"""Angle between two mountings that are of the same camera."""


def camera_check(config: ServiceConfig, goal: Goal) -> Check:
    """Compare the camera that flies with the one that took the goal."""
    flown, taken = config.camera.model(), goal.sidecar.camera
    if flown is None:
        flown = taken
    detail = f"{flown.width} x {flown.height} px, focal length {flown.fx:.0f} px"
    difference = calibration_difference(flown, taken, "goal's")
    if difference:
        remedy = "take the goal with the camera that flies, or calibrate again"
        return Check("camera", False, f"{detail}; {difference}", remedy)
    difference = mount_difference(config.camera.mount or Mount(), goal.sidecar.mount)
    if difference:
        remedy = "right if the goal's camera sat so; else take the goal again with --config"
        return Check("camera", False, f"{detail}; {difference}", remedy, binding=False)
    return Check("camera", True, detail)


def camera_checks(config: ServiceConfig, route: Sequence[tuple[Path, Goal]]) -> tuple[Check, ...]:
    """Compare the camera that flies with that of every goal of a route.

    Each goal that does not pass has its line, which names it; one line says that all pass.
    """
    checks = [(goal_path, camera_check(config, goal)) for goal_path, goal in route]
    failed = [
        replace(check, detail=f"goal image {goal_path}: {check.detail}")
        for goal_path, check in checks
        if not check.ok
    ]
    return tuple(failed) or (checks[0][1],)


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
