"""CDR serialisation of ROS 2 messages through rosbags."""

import functools
from typing import Any

from dfvs_core.errors import ConfigError, WireError

try:
    from rosbags.serde import SerdeError
    from rosbags.typesys import Stores, get_typestore
    from rosbags.typesys.store import Typestore
except ImportError as error:
    raise ConfigError(
        f"ROS 2 messages cannot be read ({error})",
        "the package rosbags",
        "install it with: pip install 'dfvs[ros]'",
    ) from error


@functools.cache
def typestore() -> Typestore:
    """Message definitions; those that we use are the same from Humble to this day."""
    return get_typestore(Stores.ROS2_HUMBLE)


def type_hash(type_name: str) -> str:
    """Hash of a type as ROS 2 spells it: ``RIHS01_...``."""
    return typestore().hash_rihs01(type_name)


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


def encode(type_name: str, message: object) -> bytes:
    """CDR of a message, with its header."""
    return bytes(typestore().serialize_cdr(message, type_name))


def make(type_name: str, *fields: Any) -> Any:
    """Message from the values of its fields, in the order of its definition."""
    return typestore().types[type_name](*fields)
