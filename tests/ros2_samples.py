"""ROS 2 messages as their senders make them, byte for byte, with a picture in them."""

import numpy as np

from dfvs_core.messages.ros2 import CAMERA_INFO, COMPRESSED_IMAGE, IMAGE
from dfvs_service.ros2.messages import encode, typestore

STAMP_NS = 1_700_000_000_123_456_789


def _types():
    types = typestore().types
    return types["std_msgs/msg/Header"], types["builtin_interfaces/msg/Time"]


def header(stamp_ns=STAMP_NS):
    Header, Time = _types()
    return Header(Time(*divmod(stamp_ns, 1_000_000_000)), "camera")


def image_message(pixels, encoding, *, step=None, is_bigendian=0, stamp_ns=STAMP_NS):
    """CDR of an Image; ``pixels`` is (H, W, bytes a pixel) uint8, ``step`` adds padding."""
    height, width, size = pixels.shape
    step = width * size if step is None else step
    rows = np.full((height, step), 0xEE, np.uint8)
    rows[:, : width * size] = pixels.reshape(height, -1)
    Image = typestore().types[IMAGE]
    message = Image(header(stamp_ns), height, width, encoding, is_bigendian, step, rows.reshape(-1))
    return encode(IMAGE, message)


def compressed_message(data, kind="jpeg", stamp_ns=STAMP_NS):
    CompressedImage = typestore().types[COMPRESSED_IMAGE]
    return encode(
        COMPRESSED_IMAGE, CompressedImage(header(stamp_ns), kind, np.frombuffer(data, np.uint8))
    )


def info_message(size, k, d=(), model="plumb_bob", p=(0.0,) * 12, **changes):
    types = typestore().types
    Roi = types["sensor_msgs/msg/RegionOfInterest"]
    fields = {"binning_x": 0, "binning_y": 0, "roi": Roi(0, 0, 0, 0, False), **changes}
    info = types[CAMERA_INFO](
        header(),
        size[1],
        size[0],
        model,
        np.array(d, np.float64),
        np.array(k, np.float64),
        np.eye(3).reshape(-1),
        np.array(p, np.float64),
        **fields,
    )
    return encode(CAMERA_INFO, info)
