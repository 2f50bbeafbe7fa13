"""ROS 2 over Zenoh (rmw_zenoh): keys, attachments and liveliness tokens.

Two programs bring ROS 2 to Zenoh. ``rmw_zenoh`` is a middleware of ROS 2 itself: its keys carry
domain, topic, type and the type's hash, its samples an attachment of 33 bytes, and publishers
announce themselves by liveliness tokens. ``zenoh-bridge-ros2dds`` stands beside a DDS system: its
keys are the topics' names, and the payload is all there is. The payload is CDR with its header of
4 bytes in both.
"""

import re
import struct
from dataclasses import dataclass
from typing import Literal

from dfvs_core.errors import ConfigError, WireError

Ros2Link = Literal["rmw", "bridge"]

IMAGE = "sensor_msgs/msg/Image"
COMPRESSED_IMAGE = "sensor_msgs/msg/CompressedImage"
CAMERA_INFO = "sensor_msgs/msg/CameraInfo"

_TOPIC = re.compile(r"/?[A-Za-z_][A-Za-z0-9_]*(/[A-Za-z_][A-Za-z0-9_]*)*")
_ATTACHMENT = struct.Struct("<qqB16s")
_GID_BYTES = 16
_ADMIN = "@ros2_lv"
_DEFAULT_QOS = "::,10:,:,:,,"
"""Reliable, volatile, keep the last ten: what is left out is ROS 2's default."""


def vehicle_namespace(vehicle: str) -> str:
    """Namespace of the topics of a vehicle of that name.

    Raises
    ------
    ConfigError
        If the name begins with a digit, which ROS 2 does not allow.
    """
    if vehicle[:1].isdigit():
        raise ConfigError(
            f"vehicle name {vehicle!r} with ROS 2",
            "a name that begins with a letter",
            "set vehicle.name in the settings of all programs, such as 'drone7'",
        )
    return vehicle.replace("-", "_")


@dataclass(frozen=True, slots=True)
class Ros2Topic:
    """A topic and its type, such as ``drone1/camera/image_raw``, ``sensor_msgs/msg/Image``.

    ``domain`` is the ROS domain; the bridge's keys do not contain it.
    """

    name: str
    type_name: str
    domain: int = 0

    def __post_init__(self) -> None:
        """Refuse names that ROS 2 does not know."""
        if not _TOPIC.fullmatch(self.name):
            raise ConfigError(
                f"ROS 2 topic {self.name!r}",
                "names of letters, digits and '_', none first a digit, between slashes",
            )

    @property
    def plain(self) -> str:
        """Name without the leading slash."""
        return self.name.removeprefix("/")

    @property
    def dds_type(self) -> str:
        """Type as DDS spells it: ``sensor_msgs::msg::dds_::Image_``."""
        package, _, rest = self.type_name.partition("/")
        group, _, name = rest.partition("/")
        return f"{package}::{group}::dds_::{name}_"

    def key(self, link: Ros2Link, type_hash: str = "*") -> str:
        """Zenoh key; with the default hash a key expression for messages of any version."""
        if link == "bridge":
            return self.plain
        return f"{self.domain}/{self.plain}/{self.dds_type}/{type_hash}"


@dataclass(frozen=True, slots=True)
class Ros2Attachment:
    """What rmw_zenoh attaches: sequence number, wall-clock time in ns, the publisher's id."""

    seq: int
    stamp_ns: int
    gid: bytes

    def encode(self) -> bytes:
        """Attachment of 33 bytes."""
        return _ATTACHMENT.pack(self.seq, self.stamp_ns, _GID_BYTES, self.gid)


def decode_attachment(data: bytes) -> Ros2Attachment:
    """Read what rmw_zenoh attached.

    Raises
    ------
    WireError
        If it is of another version.
    """
    if len(data) != _ATTACHMENT.size:
        raise WireError(f"ROS 2 attachment of {len(data)} bytes", f"{_ATTACHMENT.size} bytes")
    seq, stamp_ns, length, gid = _ATTACHMENT.unpack(data)
    if length != _GID_BYTES:
        raise WireError(f"ROS 2 attachment with an id of {length} bytes", f"{_GID_BYTES}")
    return Ros2Attachment(seq, stamp_ns, gid)


@dataclass(frozen=True, slots=True)
class Ros2Node:
    """Who announces publishers: the Zenoh session's id (hexadecimal) and the node's name."""

    session: str
    name: str
    domain: int = 0

    def token(self) -> str:
        """Liveliness token of the node."""
        return f"{_ADMIN}/{self.domain}/{self.session}/0/0/NN/%/%/{self.name}"

    def publisher_token(self, topic: Ros2Topic, type_hash: str, entity: int) -> str:
        """Liveliness token of one of its publishers, by which ``ros2 topic list`` finds it."""
        name = "%" + topic.plain.replace("/", "%")
        return (
            f"{_ADMIN}/{self.domain}/{self.session}/0/{entity}/MP/%/%/{self.name}/"
            f"{name}/{topic.dds_type}/{type_hash}/{_DEFAULT_QOS}"
        )
