"""The mock camera as a ROS 2 driver would publish it: Image or CompressedImage, and CameraInfo."""

import time
from dataclasses import dataclass
from typing import Any

import numpy as np
import zenoh

from dfvs_common import ros2
from dfvs_common.ros2 import Ros2Publisher, make
from dfvs_core.geometry.camera import CameraModel
from dfvs_core.messages.frame import FrameHeader, PixelFormat, decode_header
from dfvs_core.messages.ros2 import (
    CAMERA_INFO,
    COMPRESSED_IMAGE,
    IMAGE,
    Ros2Link,
    Ros2Node,
    Ros2Topic,
)

NODE = "dfvs_sim_camera"
FRAME_ID = "camera_optical"
_ENCODINGS = {PixelFormat.RGB8: ("rgb8", 3), PixelFormat.MONO8: ("mono8", 1)}
_COMPRESSED = {PixelFormat.JPEG: "jpeg", PixelFormat.PNG: "png"}


@dataclass(frozen=True, slots=True)
class Ros2CameraConfig:
    """Where the messages go; ``camera_name`` is the namespace of the image and its CameraInfo."""

    link: Ros2Link
    camera: CameraModel
    pixel_format: PixelFormat
    camera_name: str = "drone1/camera"
    domain: int = 0

    @property
    def image(self) -> Ros2Topic:
        """Topic of the images, named as ROS 2's image_transport does."""
        if self.pixel_format in _COMPRESSED:
            name = f"{self.camera_name}/image_raw/compressed"
            return Ros2Topic(name, COMPRESSED_IMAGE, self.domain)
        return Ros2Topic(f"{self.camera_name}/image_raw", IMAGE, self.domain)

    @property
    def info(self) -> Ros2Topic:
        """Topic of the calibration."""
        return Ros2Topic(f"{self.camera_name}/camera_info", CAMERA_INFO, self.domain)


class Ros2Camera:
    """Takes the mock camera's frames and publishes them as ROS 2 messages.

    Raises
    ------
    ConfigError
        If rosbags is not installed.
    """

    def __init__(self, session: zenoh.Session, config: Ros2CameraConfig) -> None:
        self._config = config
        node = Ros2Node(str(session.zid()), NODE, config.domain)
        self._image, self._info = (
            Ros2Publisher(session, config.link, topic, node, entity)
            for entity, topic in enumerate((config.image, config.info), start=1)
        )
        is_rmw = config.link == "rmw"
        self._token = session.liveliness().declare_token(node.token()) if is_rmw else None

    def publish(self, payload: bytes, attachment: bytes, _encoding: str) -> None:
        """Publish a frame that comes in our own wire format."""
        header = decode_header(attachment)
        stamp_ns = header.t_capture_ns + time.time_ns() - time.monotonic_ns()
        ros_header = ros2.header(stamp_ns, FRAME_ID)
        if header.pixel_format in _COMPRESSED:
            message = _compressed(ros_header, header, payload)
        else:
            message = _image(ros_header, header, payload)
        self._image.put(message, stamp_ns, header.seq)
        info = _camera_info(ros_header, self._config.camera)
        self._info.put(info, stamp_ns, header.seq)


def _image(ros_header: Any, header: FrameHeader, payload: bytes) -> Any:
    encoding, channels = _ENCODINGS[header.pixel_format]
    pixels = np.frombuffer(payload, np.uint8)
    step = header.width * channels
    return make(IMAGE, ros_header, header.height, header.width, encoding, 0, step, pixels)


def _compressed(ros_header: Any, header: FrameHeader, payload: bytes) -> Any:
    kind = f"rgb8; {_COMPRESSED[header.pixel_format]} compressed bgr8"
    return make(COMPRESSED_IMAGE, ros_header, kind, np.frombuffer(payload, np.uint8))


def _camera_info(ros_header: Any, camera: CameraModel) -> Any:
    """CameraInfo; ROS puts the first pixel's centre at 0, we at 0.5."""
    k = np.array([camera.fx, 0, camera.cx - 0.5, 0, camera.fy, camera.cy - 0.5, 0, 0, 1.0])
    p = np.insert(k, [3, 6, 9], 0.0)
    model = "rational_polynomial" if len(camera.distortion) == 8 else "plumb_bob"
    d = np.array(camera.distortion or (0.0,) * 5)
    whole = make("sensor_msgs/msg/RegionOfInterest", 0, 0, 0, 0, False)
    r = np.eye(3).reshape(-1)
    return make(
        CAMERA_INFO, ros_header, camera.height, camera.width, model, d, k, r, p, 0, 0, whole
    )
