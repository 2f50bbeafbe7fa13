"""Check that the flying camera's calibration agrees with the goal's."""

from dfvs_core.gate.checks.preflight import Check
from dfvs_core.geometry.camera import CameraModel
from dfvs_core.messages.goal import Goal
from dfvs_service.settings.config import ServiceConfig

_TOLERANCE = 0.02
"""Relative difference of two calibrations that are of the same camera."""


def camera_check(config: ServiceConfig, goal: Goal) -> Check:
    """Compare the camera that flies with the one that took the goal."""
    flown, taken = config.camera.model(), goal.sidecar.camera
    if flown is None:
        flown = taken
    detail = f"{flown.width} x {flown.height} px, focal length {flown.fx:.0f} px"
    difference = calibration_difference(flown, taken)
    if not difference:
        return Check("camera", True, detail)
    remedy = "take the goal with the camera that flies, or calibrate again"
    return Check("camera", False, f"{detail}; {difference}", remedy)


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
