"""How the demo's frames travel to the service: in our own format, or as ROS 2 messages."""

from dataclasses import dataclass

import zenoh

from dfvs_core.geometry.camera import CameraModel
from dfvs_core.messages.frame import PixelFormat
from dfvs_core.messages.ros2 import Ros2Link
from dfvs_sim.camera.mock import Publish, zenoh_publisher
from dfvs_sim.camera.ros2 import Ros2Camera, Ros2CameraConfig

CAMERAS = ("dfvs", "ros2-rmw", "ros2-bridge")
_ROS2: dict[str, tuple[Ros2Link, PixelFormat]] = {
    "ros2-rmw": ("rmw", PixelFormat.RGB8),
    "ros2-bridge": ("bridge", PixelFormat.JPEG),
}


@dataclass(frozen=True, slots=True)
class CameraLink:
    """One way of frames; ``ros2`` is None for our own."""

    vehicle: str
    pixel_format: PixelFormat = PixelFormat.JPEG
    ros2: Ros2CameraConfig | None = None

    @property
    def service_words(self) -> tuple[str, ...]:
        """Words that tell ``dfvs-service`` where the frames are."""
        if self.ros2 is None:
            return ()
        compressed = str(self.pixel_format is PixelFormat.JPEG).lower()
        return (
            *("--set", f"camera.source=ros2-{self.ros2.link}"),
            *("--set", f"camera.ros2.topic={self.ros2.image.name}"),
            *("--set", f"camera.ros2.compressed={compressed}"),
        )

    def publisher(self, session: zenoh.Session) -> Publish:
        """What takes the camera's frames."""
        if self.ros2 is None:
            return zenoh_publisher(session, self.vehicle)
        return Ros2Camera(session, self.ros2).publish


def camera_link(name: str, vehicle: str, camera: CameraModel) -> CameraLink:
    """Way of frames by one of the names in ``CAMERAS``."""
    if name not in _ROS2:
        return CameraLink(vehicle)
    link, pixel_format = _ROS2[name]
    ros2 = Ros2CameraConfig(link, camera, pixel_format, f"{vehicle}/camera")
    return CameraLink(vehicle, pixel_format, ros2)
