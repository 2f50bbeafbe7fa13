"""Check that the flying camera's calibration and mounting agree with the goal's."""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from dfvs_core.gate.checks.preflight import Check
from dfvs_core.geometry.camera import calibration_difference
from dfvs_core.messages.goal import Goal, Mount, mount_difference
from dfvs_service.settings.config import ServiceConfig


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
