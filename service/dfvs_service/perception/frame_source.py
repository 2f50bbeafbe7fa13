"""Frame sources: DFVS cameras or ROS 2."""

from typing import Protocol

from dfvs_core.geometry.camera import CameraModel
from dfvs_core.messages.schema import from_json
from dfvs_core.messages.topics import Topics
from dfvs_service.frames import RawSample
from dfvs_service.settings.config import ServiceConfig


class FrameSource(Protocol):
    """Where frames and the camera's calibration come from, and what they look like there."""

    key: str
    calibration_key: str

    def translate(self, sample: RawSample) -> RawSample:
        """Sample in our own wire format.

        Raises
        ------
        DfvsError
            If it cannot be used.
        """

    def camera(self, payload: bytes) -> CameraModel | None:
        """Camera that an announcement describes, None where it is not calibrated.

        Raises
        ------
        DfvsError
            If it cannot be read.
        """


class DfvsFrameSource:
    """Frames in our own wire format: nothing to be done."""

    def __init__(self, topics: Topics) -> None:
        self.key = topics.camera
        self.calibration_key = topics.calibration

    def translate(self, sample: RawSample) -> RawSample:
        """Return the sample itself."""
        return sample

    def camera(self, payload: bytes) -> CameraModel | None:
        """Camera as JSON."""
        return from_json(CameraModel, payload, ignore_unknown=True)


def make_frame_source(config: ServiceConfig, clock: bytes) -> FrameSource:
    """FrameSource of the camera that the settings name.

    Raises
    ------
    ConfigError
        If ROS 2 is asked for and rosbags is not installed, or a topic's name is none.
    """
    source = config.camera.source
    if source == "dfvs":
        return DfvsFrameSource(Topics(config.vehicle.name))
    # rosbags is needed here alone, and is an extra.
    from dfvs_service.ros2.frame_source import Ros2FrameSource

    return Ros2FrameSource("rmw" if source == "ros2-rmw" else "bridge", config.camera.ros2, clock)
