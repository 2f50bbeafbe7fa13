"""ROS 2 messages, and their publishing over Zenoh; rosbags is loaded by the first use."""

from __future__ import annotations

import functools
import itertools
import os
from typing import TYPE_CHECKING, Any

import zenoh

from dfvs_core.errors import ConfigError, WireError
from dfvs_core.messages.ros2 import Ros2Attachment, Ros2Link, Ros2Node, Ros2Topic

if TYPE_CHECKING:
    from rosbags.typesys.store import Typestore

_NS = 1_000_000_000


@functools.cache
def typestore() -> Typestore:
    """Message definitions; those that we use are the same from Humble to this day.

    Raises
    ------
    ConfigError
        If rosbags is not installed.
    """
    try:
        from rosbags.typesys import Stores, get_typestore
    except ImportError as error:
        raise ConfigError(
            f"ROS 2 messages cannot be read or written ({error})",
            "the package rosbags",
            "install it with: pip install 'dfvs[ros]'",
        ) from error
    return get_typestore(Stores.ROS2_HUMBLE)


def type_hash(type_name: str) -> str:
    """Hash of a type as ROS 2 spells it: ``RIHS01_...``."""
    return typestore().hash_rihs01(type_name)


def encode(type_name: str, message: object) -> bytes:
    """CDR of a message, with its header."""
    return bytes(typestore().serialize_cdr(message, type_name))


def decode(type_name: str, payload: bytes) -> Any:
    """Message from CDR with its header; arrays are views into the payload.

    Raises
    ------
    WireError
        If the bytes are no such message.
    """
    types = typestore()
    from rosbags.serde import SerdeError

    try:
        return types.deserialize_cdr(payload, type_name)
    except SerdeError as error:
        name = type_name.rpartition("/")[2]
        raise WireError(f"{len(payload)} bytes are no ROS 2 {name}: {error}") from error


def make(type_name: str, *fields: Any) -> Any:
    """Message from the values of its fields, in the order of its definition."""
    return typestore().types[type_name](*fields)


def header(stamp_ns: int, frame: str) -> Any:
    """Header with a wall-clock time."""
    stamp = make("builtin_interfaces/msg/Time", *divmod(stamp_ns, _NS))
    return make("std_msgs/msg/Header", stamp, frame)


class Ros2Publisher:
    """A ROS 2 publisher of one topic: key, attachment and, for rmw_zenoh, its announcement.

    Parameters
    ----------
    session : zenoh.Session
        Of the ROS 2 side.
    link : {"rmw", "bridge"}
    topic : Ros2Topic
    node : Ros2Node
        Who publishes.
    entity : int
        Number of the publisher in its node, from 1.

    Raises
    ------
    ConfigError
        If rosbags is not installed.
    """

    def __init__(
        self, session: zenoh.Session, link: Ros2Link, topic: Ros2Topic, node: Ros2Node, entity: int
    ) -> None:
        self.topic = topic
        self._is_rmw = link == "rmw"
        self._gid = os.urandom(16)
        self._count = itertools.count(1)
        type_ = type_hash(topic.type_name)
        self._publisher = session.declare_publisher(
            topic.key(link, type_), congestion_control=zenoh.CongestionControl.DROP
        )
        self._token: zenoh.LivelinessToken | None = None
        if self._is_rmw:
            token = node.publisher_token(topic, type_, entity)
            self._token = session.liveliness().declare_token(token)

    def put(self, message: object, stamp_ns: int, seq: int | None = None) -> None:
        """Publish a message with its wall-clock time; without ``seq`` messages are counted."""
        if seq is None:
            seq = next(self._count)
        attachment = Ros2Attachment(seq, stamp_ns, self._gid).encode()
        data = encode(self.topic.type_name, message)
        self._publisher.put(data, attachment=attachment if self._is_rmw else None)
