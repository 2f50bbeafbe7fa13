"""Newest frame of perception with its flow and result, from a service that runs."""

import contextlib
import math
import threading
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import zenoh

from dfvs_core.errors import WireError
from dfvs_core.geometry.arrays import ImageArray
from dfvs_core.messages.frame_record import FrameRecord, unpack
from dfvs_core.messages.topics import Topics
from dfvs_core.perception.flow_grid import FlowGrid, decode_flow_grid
from dfvs_service.frames import record_image
from dfvs_service.settings.sections import ZenohSection
from dfvs_service.zenoh_session import open_within

_RECORDS = 16
"""Frame records kept until the flow of one of them arrives: flow comes at 10 Hz, frames faster."""


@dataclass(frozen=True, slots=True)
class View:
    """Newest frame, and the flow and the servo document of the very same frame where known.

    ``image`` is (H, W, 3) RGB, ``flow`` leads to the goal in px of the image.
    """

    image: ImageArray | None = None
    flow: FlowGrid | None = None
    servo: dict[str, Any] = field(default_factory=dict)


class ViewCollector:
    """Takes frame records and flow grids as they come, from any thread.

    A frame with its flow counts more than a newer one without.
    """

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._records: deque[tuple[FrameRecord, bytes]] = deque(maxlen=_RECORDS)
        self._matched: tuple[FrameRecord, bytes, FlowGrid] | None = None

    def add_record(self, data: bytes) -> None:
        """Take a message of the ``turn`` stream."""
        record, payload = unpack(FrameRecord, data)
        if record.sight is not None:
            with self._lock:
                self._records.append((record, payload))

    def add_flow(self, data: bytes) -> None:
        """Take a message of the ``flow`` stream."""
        grid = decode_flow_grid(data)
        with self._lock:
            for record, payload in self._records:
                if record.servo.get("t_capture_ns") == grid.t_capture_ns:
                    self._matched = record, payload, grid

    def view(self) -> View:
        """Best view so far."""
        with self._lock:
            matched = self._matched
            newest = self._records[-1] if self._records else None
        if matched is not None:
            record, payload, grid = matched
            return View(record_image(record, payload), grid, record.servo)
        return View() if newest is None else View(record_image(*newest), None, newest[0].servo)


class LiveView:
    """Subscribes to frame records and flow, from a thread that waits for its operator link."""

    def __init__(self, section: ZenohSection, topics: Topics) -> None:
        self._section = section
        self._topics = topics
        self._views = ViewCollector()
        self._closed = threading.Event()
        self._thread = threading.Thread(target=self._run, name="live-view", daemon=True)
        self._thread.start()

    def close(self) -> View:
        """End, and give the best view."""
        self._closed.set()
        self._thread.join()
        return self._views.view()

    def _run(self) -> None:
        session = open_within(self._section, math.inf, self._closed.is_set)
        if session is None:
            return
        with session:
            takers = {"turn": self._views.add_record, "flow": self._views.add_flow}
            subscribers = [
                session.declare_subscriber(self._topics.telemetry(name), _taker(take))
                for name, take in takers.items()
            ]
            self._closed.wait()
            del subscribers


def _taker(take: Callable[[bytes], None]) -> Callable[[zenoh.Sample], None]:
    def receive_sample(sample: zenoh.Sample) -> None:
        with contextlib.suppress(WireError):  # of another service's version
            take(sample.payload.to_bytes())

    return receive_sample
