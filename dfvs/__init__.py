"""Python API of DFVS: match images, servo to a goal image, read recorded flights.

Everything is loaded when it is first used.
"""

from importlib import import_module
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from dfvs.matching import ImageMatch, match_images
    from dfvs.servoing import Servo
    from dfvs_core.errors import DfvsError
    from dfvs_core.geometry.camera import CameraModel
    from dfvs_core.matching.correspondence import FlowField
    from dfvs_core.matching.matcher import Matcher
    from dfvs_core.matching.relative_pose import RelativePose
    from dfvs_core.messages.goal import Goal, GoalSidecar, Mount
    from dfvs_core.perception.vehicle_history import Motion
    from dfvs_core.servo.config import ServoConfig
    from dfvs_core.servo.exchange import ServoResult, Status
    from dfvs_models.catalog import load_matcher
    from dfvs_service.report.flight import Flight, FlightSource, FlightView
    from dfvs_service.report.source import open_flight
    from dfvs_service.settings.goal_file import load_goal, read_image

__all__ = [
    "CameraModel",
    "DfvsError",
    "Flight",
    "FlightSource",
    "FlightView",
    "FlowField",
    "Goal",
    "GoalSidecar",
    "ImageMatch",
    "Matcher",
    "Motion",
    "Mount",
    "RelativePose",
    "Servo",
    "ServoConfig",
    "ServoResult",
    "Status",
    "load_goal",
    "load_matcher",
    "match_images",
    "open_flight",
    "read_image",
]

_MODULES = {
    "dfvs.matching": ("ImageMatch", "match_images"),
    "dfvs.servoing": ("Servo",),
    "dfvs_core.geometry.camera": ("CameraModel",),
    "dfvs_core.matching.correspondence": ("FlowField",),
    "dfvs_core.errors": ("DfvsError",),
    "dfvs_core.messages.goal": ("Goal", "GoalSidecar", "Mount"),
    "dfvs_core.matching.matcher": ("Matcher",),
    "dfvs_core.matching.relative_pose": ("RelativePose",),
    "dfvs_core.servo.config": ("ServoConfig",),
    "dfvs_core.servo.exchange": ("ServoResult", "Status"),
    "dfvs_core.perception.vehicle_history": ("Motion",),
    "dfvs_models.catalog": ("load_matcher",),
    "dfvs_service.settings.goal_file": ("load_goal", "read_image"),
    "dfvs_service.report.flight": ("Flight", "FlightSource", "FlightView"),
    "dfvs_service.report.source": ("open_flight",),
}
"""Where each name is defined."""


def __getattr__(name: str) -> object:
    """Import a name at its first use."""
    for module, names in _MODULES.items():
        if name in names:
            value: object = getattr(import_module(module), name)
            globals()[name] = value
            return value
    raise AttributeError(f"module 'dfvs' has no attribute {name!r}")


def __dir__() -> list[str]:
    return __all__
