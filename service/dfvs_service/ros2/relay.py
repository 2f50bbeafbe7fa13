"""Relay of the service's telemetry from Zenoh to ROS 2 messages."""

import logging
import threading
import time
from collections.abc import Callable, Mapping
from typing import Any

import zenoh

from dfvs_common.clock import local_clock
from dfvs_common.ros2 import Ros2Publisher
from dfvs_core.errors import WireError
from dfvs_core.messages.frame import FrameHeader, decode_header
from dfvs_core.messages.ros2 import Ros2Link, Ros2Node, Ros2Topic, vehicle_namespace
from dfvs_core.messages.topics import Topics
from dfvs_service.ros2.telemetry import (
    DIAGNOSTICS,
    IMAGE,
    TWIST,
    diagnostics_message,
    preview_message,
    setpoint_message,
)
from dfvs_service.zenoh_session import attachment_of, subscribe_json

_SERVO_AGE_NS = 1_000_000_000
"""Figures of a frame are left out once they are older."""

log = logging.getLogger("dfvs.ros2")


class Relay:
    """Telemetry of one vehicle, from the service's session to that of ROS 2.

    ``sessions`` are where telemetry comes from, and where it goes to; they may be the same.
    ``domain`` is the ROS domain, and ``tick`` gives monotonic ns.
    """

    def __init__(
        self,
        vehicle: str,
        sessions: tuple[zenoh.Session, zenoh.Session],
        link: Ros2Link,
        domain: int,
        tick: Callable[[], int] = time.monotonic_ns,
    ) -> None:
        service, ros = sessions
        self._vehicle = vehicle
        self._lock = threading.Lock()
        self._tick = tick
        self._servo: Mapping[str, Any] = {}
        self._servo_ns = tick()
        """Time of arrival: the document's own may be by another machine's clock."""
        space = vehicle_namespace(vehicle)
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
        self._subscribers = [
            subscribe_json(service, topics.telemetry("state"), self._on_state),
            subscribe_json(service, topics.telemetry("servo"), self._on_servo),
            service.declare_subscriber(topics.telemetry("preview"), self._on_preview),
        ]

    def _on_servo(self, document: Mapping[str, Any] | None) -> None:
        if document is None:
            log.warning("servo left out: no JSON object")
            return
        with self._lock:
            self._servo, self._servo_ns = document, self._tick()

    def _on_state(self, document: Mapping[str, Any] | None) -> None:
        if document is None:
            log.warning("state left out: no JSON object")
            return
        stamp_ns = time.time_ns()
        with self._lock:
            is_old = bool(self._servo) and self._tick() - self._servo_ns > _SERVO_AGE_NS
            servo = None if is_old else self._servo
        try:
            twist = setpoint_message(document, stamp_ns)
            report = diagnostics_message(self._vehicle, document, servo, stamp_ns)
        except (KeyError, TypeError, ValueError) as error:
            log.warning("state left out: %s", error)
            return
        self._setpoints.put(twist, stamp_ns)
        self._diagnostics.put(report, stamp_ns)

    def _on_preview(self, sample: zenoh.Sample) -> None:
        try:
            header = decode_header(attachment_of(sample))
        except WireError as error:
            log.warning("preview left out: %s", error)
            return
        stamp_ns = _stamp_ns(header)
        self._previews.put(preview_message(sample.payload.to_bytes(), stamp_ns), stamp_ns)


def _stamp_ns(header: FrameHeader) -> int:
    """Wall-clock time of capture, or of arrival where another machine's clock stamped the frame."""
    now_ns = time.time_ns()
    if header.clock != local_clock():
        return now_ns
    return header.t_capture_ns + now_ns - time.monotonic_ns()
