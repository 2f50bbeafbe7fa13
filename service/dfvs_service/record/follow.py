"""Subscription to one vehicle's frame records over Zenoh, and their order."""

import threading
import time
from collections import deque
from collections.abc import Iterator
from functools import partial
from types import FrameType
from typing import Any

import zenoh

from dfvs_common.progress import log
from dfvs_core.errors import WireError
from dfvs_core.messages.frame_record import FrameRecord, SessionHeader, unpack
from dfvs_core.messages.topics import Topics
from dfvs_core.perception.flow_grid import FlowGrid, decode_flow_grid
from dfvs_service.command import operators_zenoh
from dfvs_service.settings.config import ServiceConfig
from dfvs_service.zenoh_session import open_persistently, require_usable_files, subscribe_kept

_WAIT_S = 0.2
_DRAIN_S = 0.5
_CONNECT_PAUSE_S = 0.2

MAX_WAITING_BYTES = 128 * 1024 * 1024
_BATCH = 4
"""Few enough that whoever is told to end is asked in time."""

Event = tuple[SessionHeader | FrameRecord | FlowGrid, bytes]
"""What was published, and the bytes beside it: a goal's image, or a sample's payload."""

_Kind = type[SessionHeader] | type[FrameRecord] | type[FlowGrid]


class RecordListener:
    """Receives what perception publishes, and keeps it until it is requested.

    The callbacks only queue: a Zenoh thread that waits would hold up its whole session.
    """

    def __init__(self, session: zenoh.Session, topics: Topics) -> None:
        self._condition = threading.Condition()
        self._waiting: deque[tuple[_Kind, bytes]] = deque()
        self._waiting_bytes = 0
        self.dropped = 0
        self._has_told = False
        self._sequencer = RecordSequencer()
        header, turn, flow = (topics.telemetry(name) for name in ("opening", "turn", "flow"))
        # Zenoh's subscribers carry no types where they are undeclared.
        self._subscribers: list[Any] = [
            subscribe_kept(session, header, partial(self._put, SessionHeader)),
            session.declare_subscriber(turn, partial(self._put, FrameRecord)),
            session.declare_subscriber(flow, partial(self._put, FlowGrid)),
        ]

    def receive(self, timeout_s: float) -> list[Event]:
        """Some of what came since, in order; waits at most so long for something to come."""
        with self._condition:
            if not self._waiting:
                self._condition.wait(timeout_s)
            count = min(len(self._waiting), _BATCH)
            waiting = [self._waiting.popleft() for _ in range(count)]
            self._waiting_bytes -= sum(len(data) for _, data in waiting)
        events: list[Event] = []
        for kind, data in waiting:
            try:
                if issubclass(kind, FlowGrid):
                    events.append((decode_flow_grid(data), b""))
                else:
                    events += self._sequencer.put(*unpack(kind, data))
            except WireError as error:
                if not self._has_told:
                    log(f"left out: {error}; is the service of another version?")
                    self._has_told = True
                self.dropped += 1
        return events

    def close(self) -> None:
        """Stop listening; what was not taken counts as dropped."""
        self.dropped += len(self._waiting)
        for subscriber in self._subscribers:
            subscriber.undeclare()

    def _put(self, kind: _Kind, sample: zenoh.Sample) -> None:
        """Zenoh's thread: queue what fits."""
        data = sample.payload.to_bytes()
        with self._condition:
            if self._waiting_bytes + len(data) > MAX_WAITING_BYTES:
                self.dropped += 1
                return
            self._waiting.append((kind, data))
            self._waiting_bytes += len(data)
            self._condition.notify()


class RecordSequencer:
    """Gives every session header right before the first frame record that it holds for.

    The two come on different keys, so either may overtake the other.
    """

    _MAX_HEADERS = 8
    _MAX_EARLY_RECORDS = 256

    def __init__(self) -> None:
        self._headers: dict[int, tuple[SessionHeader, bytes]] = {}
        self._current: int | None = None
        self._early: deque[tuple[FrameRecord, bytes]] = deque(maxlen=self._MAX_EARLY_RECORDS)

    def put(self, message: SessionHeader | FrameRecord, payload: bytes) -> Iterator[Event]:
        """Take a message; gives what can be passed on now."""
        if isinstance(message, SessionHeader):
            self._headers[message.opened_ns] = (message, payload)
            while len(self._headers) > self._MAX_HEADERS:
                del self._headers[next(iter(self._headers))]
        else:
            self._early.append((message, payload))
        while self._early and self._early[0][0].opening in (self._current, *self._headers):
            record, data = self._early.popleft()
            if record.opening != self._current:
                self._current = record.opening
                yield self._headers[record.opening]
            yield record, data


class Follower:
    """Follows a service, which may come and go, until told to stop.

    Raises
    ------
    ConfigError
        If a certificate's file cannot be used.
    """

    def __init__(self, config: ServiceConfig) -> None:
        require_usable_files(config.zenoh)
        self._config = config
        self._stopped = False
        self.dropped = 0

    def stop(self, _signal: int, _frame: FrameType | None) -> None:
        """Signal handler: take what has come, then end."""
        self._stopped = True

    def events(self) -> Iterator[list[Event]]:
        """What has come, a few times a second also where nothing has."""
        section = operators_zenoh(self._config.zenoh)
        session = open_persistently(section, lambda: self._stopped, log, _CONNECT_PAUSE_S)
        if session is None:
            return
        with session:
            listener = RecordListener(session, Topics(self._config.vehicle.name))
            while not self._stopped:
                yield listener.receive(_WAIT_S)
                self.dropped = listener.dropped
            deadline = time.monotonic() + _DRAIN_S  # for what is still under way
            while time.monotonic() < deadline and (events := listener.receive(_WAIT_S)):
                yield events
            listener.close()
            self.dropped = listener.dropped
