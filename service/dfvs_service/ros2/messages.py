"""CDR serialisation of ROS 2 messages through rosbags."""

from typing import Any

from dfvs_common.ros2 import encode, header, make, type_hash, typestore
from dfvs_core.errors import ConfigError, WireError

try:
    from rosbags.serde import SerdeError
except ImportError as error:
    raise ConfigError(
        f"ROS 2 messages cannot be read ({error})",
        "the package rosbags",
        "install it with: pip install 'dfvs[ros]'",
    ) from error


__all__ = ["decode", "encode", "header", "make", "type_hash", "typestore"]


def decode(type_name: str, payload: bytes) -> Any:
    """Message from CDR with its header; arrays are views into the payload.

    Raises
    ------
    WireError
        If the bytes are no such message.
    """
    try:
        return typestore().deserialize_cdr(payload, type_name)
    except SerdeError as error:
        name = type_name.rpartition("/")[2]
        raise WireError(f"{len(payload)} bytes are no ROS 2 {name}: {error}") from error
