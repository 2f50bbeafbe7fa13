"""Writer of a goal's image and sidecar."""

from __future__ import annotations

import datetime
from pathlib import Path

from dfvs_core.errors import ConfigError
from dfvs_core.geometry.arrays import ImageArray
from dfvs_core.geometry.camera import CameraModel
from dfvs_core.messages.goal import GoalSidecar, Mount
from dfvs_core.messages.image import encode_png
from dfvs_core.perception.vehicle_history import Motion
from dfvs_service.settings.calibration_file import replace_file


def sidecar_of(camera: CameraModel, mount: Mount, motion: Motion | None) -> GoalSidecar:
    """Sidecar of an image that is taken now; without a motion the vehicle counts as level."""
    now = datetime.datetime.now(datetime.UTC).isoformat(timespec="milliseconds")
    roll, pitch = (0.0, 0.0) if motion is None else (motion.roll_rad, motion.pitch_rad)
    return GoalSidecar(camera, roll, pitch, mount, taken_at=now)


def write_goal(image_path: Path, image: ImageArray, sidecar: GoalSidecar) -> None:
    """Write a goal, its sidecar first: an image is never without one.

    Raises
    ------
    ConfigError
        If the name does not end in .png, or a file cannot be written.
    """
    if image_path.suffix.lower() != ".png":
        raise ConfigError(
            f"the goal image is to be {str(image_path)!r}", "a name that ends in .png"
        )
    replace_file(image_path.with_suffix(".json"), sidecar.to_json().encode())
    replace_file(image_path, encode_png(image))
