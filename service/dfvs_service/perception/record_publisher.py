"""Publisher of frame records, on its own thread.

The queue is bounded by its bytes: a recorder that is too slow loses records, which their numbers
show, and never delays a flight. Nothing is queued while nobody records.
"""

import logging
import math
import threading
import time
from collections import deque
from collections.abc import Callable
from typing import TypeAlias

import zenoh

from dfvs_core.messages.frame_record import FrameRecord, SessionHeader, pack
from dfvs_core.messages.topics import Topics
from dfvs_service.supervisor.watched_thread import start_watched
from dfvs_service.zenoh_session import has_subscriber, publish_kept

MAX_WAITING_BYTES = 64 * 1024 * 1024
_RECORD_BYTES = 4096
"""What a frame record weighs besides its payload."""
_HEADER_PERIOD_S = 5.0
"""A recorder that has missed the session header waits at most so long for it."""

_Queued: TypeAlias = tuple[SessionHeader | FrameRecord, bytes]

log = logging.getLogger("dfvs.perception.record")


class RecordPublisher:
    """Publishes session headers (kept for recorders that join later) and frame records.

    A header is repeated every few seconds while records are published: no record can be read
    without it.

    ``report`` takes one line about a failure of the thread, from any thread. A recorder is expected
    where ``patience_s`` is not 0: records wait so long for it after the start.
    """

    def __init__(
        self,
        session: zenoh.Session,
        topics: Topics,
        report: Callable[[str], None],
        patience_s: float = 0.0,
    ) -> None:
        self._patience_s = patience_s
        self._condition = threading.Condition()
        self._waiting: deque[_Queued] = deque()
        self._waiting_bytes = 0
        self._closed = False
        self.dropped = 0
        self._header, self._repeat_at_s = b"", math.inf
        # This thread may block, up to the lease of a recorder that hangs; the queue then drops.
        block = zenoh.CongestionControl.BLOCK
        self._headers = publish_kept(session, topics.telemetry("opening"), block)
        self._records = session.declare_publisher(
            topics.telemetry("turn"), congestion_control=block, priority=zenoh.Priority.DATA_LOW
        )
        self._has_matched = threading.Event()
        self._listener = self._records.declare_matching_listener(self._on_matching)
        self.wanted = patience_s > 0 or has_subscriber(self._records)
        """Whether anybody records, or is expected to."""
        self._thread = start_watched("record-publisher", self._publish, report)

    def offer(self, message: SessionHeader | FrameRecord, payload: bytes = b"") -> None:
        """Hand on a message; a frame record that finds the queue full is dropped and counted."""
        size_bytes = _RECORD_BYTES + len(payload)
        is_record = isinstance(message, FrameRecord)
        if is_record and not self.wanted:
            return
        with self._condition:
            if is_record and self._waiting_bytes + size_bytes > MAX_WAITING_BYTES:
                self.dropped += 1
                return
            self._waiting.append((message, payload))
            self._waiting_bytes += size_bytes
            self._condition.notify()

    def close(self, timeout_s: float = 0.25) -> None:
        """Stop; what waits is still sent, within the time."""
        with self._condition:
            self._closed = True
            self._condition.notify()
        self._has_matched.set()
        self._thread.join(timeout_s)
        if self.dropped:
            log.warning("%d frame records were not handed to the recorder in time", self.dropped)

    def _on_matching(self, status: zenoh.MatchingStatus) -> None:
        """Zenoh's thread: a first recorder has come, or the last one has gone."""
        self.wanted = status.matching
        if status.matching:
            self._has_matched.set()

    def _publish(self) -> None:
        while (queued := self._next()) is not None:
            message, payload = queued
            try:
                if isinstance(message, SessionHeader):
                    self._header = pack(message, payload)
                    self._put_header()
                    self._await_recorder()
                elif self.wanted:
                    if time.monotonic() > self._repeat_at_s:
                        self._put_header()
                    self._records.put(pack(message, payload))
            except zenoh.ZError as error:
                log.warning("frame record not published: %s", error)

    def _put_header(self) -> None:
        self._repeat_at_s = time.monotonic() + _HEADER_PERIOD_S
        self._headers.put(self._header)

    def _await_recorder(self) -> None:
        """Wait, once, for the recorder that is expected."""
        if self._patience_s > 0:
            if not self._has_matched.wait(self._patience_s):
                log.warning("no recorder came within %g s", self._patience_s)
                self.wanted = has_subscriber(self._records)
            self._patience_s = 0.0

    def _next(self) -> _Queued | None:
        with self._condition:
            while not self._waiting and not self._closed:
                self._condition.wait()
            if not self._waiting:
                return None
            message, payload = self._waiting.popleft()
            self._waiting_bytes -= _RECORD_BYTES + len(payload)
            return message, payload
