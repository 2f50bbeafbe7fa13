"""ROS 2 messages as their senders make them, byte for byte, with a picture in them."""

import numpy as np

from dfvs_common.ros2 import encode, header, make
from dfvs_core.messages.ros2 import CAMERA_INFO, COMPRESSED_IMAGE, IMAGE

STAMP_NS = 1_700_000_000_123_456_789
FRAME = "camera"


def image_message(
    pixels, encoding, *, step=None, is_bigendian=0, stamp_ns=STAMP_NS, frame_id=FRAME
):
    """CDR of an Image; ``pixels`` is (H, W, bytes a pixel) uint8, ``step`` adds padding."""
    height, width, size = pixels.shape
    step = width * size if step is None else step
    rows = np.full((height, step), 0xEE, np.uint8)
    rows[:, : width * size] = pixels.reshape(height, -1)
    stamped = header(stamp_ns, frame_id)
    data = rows.reshape(-1)
    return encode(IMAGE, make(IMAGE, stamped, height, width, encoding, is_bigendian, step, data))


def compressed_message(data, kind="jpeg", stamp_ns=STAMP_NS):
    message = make(COMPRESSED_IMAGE, header(stamp_ns, FRAME), kind, np.frombuffer(data, np.uint8))
    return encode(COMPRESSED_IMAGE, message)


def info_message(size, k, d=(), model="plumb_bob", p=(0.0,) * 12, **changes):
    roi = make("sensor_msgs/msg/RegionOfInterest", 0, 0, 0, 0, False)
    fields = {"binning_x": 0, "binning_y": 0, "roi": roi} | changes
    info = make(
        CAMERA_INFO,
        header(STAMP_NS, FRAME),
        size[1],
        size[0],
        model,
        np.array(d, np.float64),
        np.array(k, np.float64),
        np.eye(3).reshape(-1),
        np.array(p, np.float64),
        *fields.values(),
    )
    return encode(CAMERA_INFO, info)
