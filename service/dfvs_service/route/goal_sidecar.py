"""Sidecar of a goal that is captured in flight."""

import datetime

from dfvs_core.geometry.camera import CameraModel
from dfvs_core.messages.goal import GoalSidecar, Mount
from dfvs_core.perception.vehicle_history import Motion


def sidecar_of(camera: CameraModel, mount: Mount, motion: Motion | None) -> GoalSidecar:
    """Sidecar of an image that is taken now; without a motion the vehicle counts as level."""
    now = datetime.datetime.now(datetime.UTC).isoformat(timespec="milliseconds")
    roll, pitch = (0.0, 0.0) if motion is None else (motion.roll_rad, motion.pitch_rad)
    return GoalSidecar(camera, roll, pitch, mount, taken_at=now)
