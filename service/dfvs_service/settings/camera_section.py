"""Settings section of the camera that flies; angles in rad."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass, field
from math import radians
from typing import Literal

from dfvs_core.errors import ConfigError
from dfvs_core.geometry.camera import CameraModel
from dfvs_core.messages.goal import Mount
from dfvs_core.messages.schema import setting
from dfvs_core.messages.zenoh_settings import MAX_MESSAGE_BYTES

CameraSource = Literal["dfvs", "ros2-rmw", "ros2-bridge"]


@dataclass(frozen=True, slots=True)
class Ros2CameraSection:
    """A camera of ROS 2, where ``camera.source`` names one of its links."""

    topic: str = setting("camera/image_raw", "image topic, with its namespaces")
    compressed: bool = setting(False, "true: the topic carries CompressedImage, not Image")
    info_topic: str = setting("", "CameraInfo's topic; empty: camera_info beside the image topic")
    domain: int = setting(0, "ROS domain of camera and telemetry (rmw_zenoh only)", low=0, high=232)


@dataclass(frozen=True, slots=True)
class CameraSection:
    """The camera that flies; what is not set is taken from the goal and its sidecar."""

    source: CameraSource = setting(
        "dfvs",
        "whose frames: dfvs (dfvs-camera), ros2-rmw (rmw_zenoh) or ros2-bridge "
        "(zenoh-bridge-ros2dds)",
    )
    width: int | None = setting(None, "width of the frames, px", low=16, high=8192)
    height: int | None = setting(None, "height of the frames, px", low=16, high=8192)
    horizontal_fov_rad: float | None = setting(
        None, "horizontal field of view of a pinhole camera", low=radians(3), high=radians(177)
    )
    fx: float | None = setting(None, "focal length, px", low=1.0)
    fy: float | None = setting(None, "focal length, px", low=1.0)
    cx: float | None = setting(None, "principal point, px; first pixel's centre is 0.5", low=0.0)
    cy: float | None = setting(None, "principal point, px; first pixel's centre is 0.5", low=0.0)
    distortion: tuple[float, ...] = setting((), "OpenCV's k1, k2, p1, p2[, k3[, k4, k5, k6]]")
    timeout_s: float = setting(
        15.0, "give up if no frame arrives for so long after the start, s", low=1.0, high=600.0
    )
    calibration_file: str = setting(
        "", "file of dfvs-camera calibrate, in place of the intrinsics above; empty: none"
    )
    announced_s: float = setting(
        0.0,
        "where no intrinsics are set, wait so long for those that the camera announces; 0: do not",
        low=0.0,
        high=60.0,
    )
    ros2: Ros2CameraSection = field(default_factory=Ros2CameraSection)
    mount: Mount | None = None

    @property
    def silence_cause(self) -> str:
        """Why images of ROS 2 may never arrive, to follow that none do; else empty."""
        width, height = self.width or 0, self.height or 0
        is_small = 3 * width * height <= MAX_MESSAGE_BYTES
        if self.source == "dfvs" or self.ros2.compressed or is_small:
            return ""
        return (
            f": colour images of {width} x {height} px are above {MAX_MESSAGE_BYTES >> 20} MiB, "
            "the limit of a message, unless compressed"
        )

    def with_model(self, model: CameraModel) -> CameraSection:
        """The same settings with the intrinsics of a camera, and no other source of them."""
        return dataclasses.replace(
            self, calibration_file="", horizontal_fov_rad=None, **dataclasses.asdict(model)
        )

    def model(self) -> CameraModel | None:
        """Camera model of these settings, None where they hold no intrinsics.

        Raises
        ------
        ConfigError
            If intrinsics are given in part, or twice.
        """
        fx, fy, cx, cy = self.fx, self.fy, self.cx, self.cy
        given = sum(value is not None for value in (fx, fy, cx, cy))
        if self.horizontal_fov_rad is None and not given and not self.distortion:
            return None
        if self.width is None or self.height is None:
            raise ConfigError("camera has intrinsics but no size", "camera.width and camera.height")
        if self.horizontal_fov_rad is not None:
            if given or self.distortion:
                raise ConfigError(
                    "camera has both horizontal_fov_deg and other intrinsics", "only one of them"
                )
            return CameraModel.from_horizontal_fov(self.width, self.height, self.horizontal_fov_rad)
        if fx is None or fy is None or cx is None or cy is None:
            raise ConfigError("camera has only some intrinsics", "all of fx, fy, cx, cy")
        return CameraModel(self.width, self.height, fx, fy, cx, cy, self.distortion)
