"""Relay of the service's telemetry from Zenoh to ROS 2 messages."""

import json
import logging
import os
import threading
import time
from collections.abc import Mapping
from typing import Any

import zenoh

from dfvs_core.errors import WireError
from dfvs_core.messages.frame import decode_header
from dfvs_core.messages.ros2 import Ros2Attachment, Ros2Link, Ros2Node, Ros2Topic
from dfvs_core.messages.topics import Topics
from dfvs_service.ros2.messages import encode, type_hash
from dfvs_service.ros2.telemetry import (
    DIAGNOSTICS,
    IMAGE,
    TWIST,
    diagnostics_message,
    preview_message,
    setpoint_message,
)

log = logging.getLogger("dfvs.ros2")


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
    """

    def __init__(
        self, session: zenoh.Session, link: Ros2Link, topic: Ros2Topic, node: Ros2Node, entity: int
    ) -> None:
        self.topic = topic
        self._is_rmw = link == "rmw"
        self._gid = os.urandom(16)
        self._seq = 0
        type_ = type_hash(topic.type_name)
        self._publisher = session.declare_publisher(
            topic.key(link, type_), congestion_control=zenoh.CongestionControl.DROP
        )
        self._token: zenoh.LivelinessToken | None = None
        if self._is_rmw:
            token = node.publisher_token(topic, type_, entity)
            self._token = session.liveliness().declare_token(token)

    def put(self, message: object, stamp_ns: int) -> None:
        """Publish a message with its wall-clock time."""
        self._seq += 1
        attachment = Ros2Attachment(self._seq, stamp_ns, self._gid).encode()
        data = encode(self.topic.type_name, message)
        self._publisher.put(data, attachment=attachment if self._is_rmw else None)


class Relay:
    """Telemetry of one vehicle, from the service's session to that of ROS 2.

    Parameters
    ----------
    vehicle : str
        Name of the vehicle.
    sessions : (zenoh.Session, zenoh.Session)
        Where telemetry comes from, and where it goes to; may be the same.
    link : {"rmw", "bridge"}
    domain : int
        ROS domain.
    """

    def __init__(
        self,
        vehicle: str,
        sessions: tuple[zenoh.Session, zenoh.Session],
        link: Ros2Link,
        domain: int,
    ) -> None:
        service, ros = sessions
        self._vehicle = vehicle
        self._lock = threading.Lock()
        self._servo: Mapping[str, Any] = {}
        space = vehicle.replace("-", "_")
        node = Ros2Node(str(ros.zid()), f"dfvs_{space}", domain)
        names = (
            (f"{space}/dfvs/setpoint", TWIST),
            ("diagnostics", DIAGNOSTICS),
            (f"{space}/dfvs/preview/compressed", IMAGE),
        )
        self.publishers = [
            Ros2Publisher(ros, link, Ros2Topic(name, type_name, domain), node, entity)
            for entity, (name, type_name) in enumerate(names, start=1)
        ]
        self._setpoints, self._diagnostics, self._previews = self.publishers
        self._node_token = ros.liveliness().declare_token(node.token()) if link == "rmw" else None
        topics = Topics(vehicle)
        callbacks = {
            "state": self._on_state,
            "servo": self._on_servo,
            "preview": self._on_preview,
        }
        self._subscribers = [
            service.declare_subscriber(topics.telemetry(name), callback)
            for name, callback in callbacks.items()
        ]

    def _on_servo(self, sample: zenoh.Sample) -> None:
        document = _document(sample)
        if document is not None:
            with self._lock:
                self._servo = document

    def _on_state(self, sample: zenoh.Sample) -> None:
        document = _document(sample)
        if document is None:
            return
        stamp_ns = time.time_ns()
        with self._lock:
            servo = self._servo
        try:
            twist = setpoint_message(document, stamp_ns)
            report = diagnostics_message(self._vehicle, document, servo, stamp_ns)
        except (KeyError, TypeError, ValueError) as error:
            log.warning("state left out: %s", error)
            return
        self._setpoints.put(twist, stamp_ns)
        self._diagnostics.put(report, stamp_ns)

    def _on_preview(self, sample: zenoh.Sample) -> None:
        attachment = b"" if sample.attachment is None else sample.attachment.to_bytes()
        try:
            t_capture_ns = decode_header(attachment).t_capture_ns
        except WireError as error:
            log.warning("preview left out: %s", error)
            return
        stamp_ns = t_capture_ns + time.time_ns() - time.monotonic_ns()
        self._previews.put(preview_message(sample.payload.to_bytes(), stamp_ns), stamp_ns)


def _document(sample: zenoh.Sample) -> Mapping[str, Any] | None:
    """JSON mapping of a sample, None where it is none."""
    try:
        document = json.loads(sample.payload.to_bytes())
    except (ValueError, RecursionError) as error:
        log.warning("telemetry left out: %s", error)
        return None
    return document if isinstance(document, dict) else None
