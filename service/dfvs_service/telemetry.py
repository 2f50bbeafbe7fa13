"""Telemetry publisher over Zenoh, on its own thread."""

import json
import logging
import threading
from collections.abc import Callable, Mapping
from dataclasses import dataclass

import zenoh
import zenoh.ext

from dfvs_core.messages.topics import Topics
from dfvs_service.supervisor.watched_thread import start_watched
from dfvs_service.zenoh_session import has_subscriber, publish_kept

log = logging.getLogger("dfvs.telemetry")

_CACHED = ("state", "config", "goal", "route")
_ON_DEMAND = ("preview", "flow")
_KEPT = ("state", "servo", "timing", "thumbnail")
_KEPT_ONCE = ("goal", "route", "build")
"""Published once, so they are sent until the black box takes them."""
_NOT_PUBLISHED = ("thumbnail", "build")


@dataclass(frozen=True, slots=True)
class Note:
    """One thing to publish: payload, encoding and attachment.

    ``kept`` goes to the black box in place of a payload that is too large for it.
    """

    payload: bytes
    encoding: str = "application/json"
    attachment: bytes | None = None
    kept: bytes | None = None


class Telemetry:
    """Publishes the newest note of every stream; older ones that were not sent are dropped.

    ``state``, ``config`` and ``goal`` are kept for subscribers that join later; ``preview`` and
    ``flow``, which cost time to make, are made only while somebody subscribes. ``thumbnail`` and
    ``build`` are for the black box alone.

    ``report`` takes one line about a failure of the thread, from any thread. ``keep`` takes stream
    and payload for the black box, returns whether that is settled, and must not block.
    """

    def __init__(
        self,
        session: zenoh.Session,
        topics: Topics,
        report: Callable[[str], None],
        keep: Callable[[str, bytes], bool],
    ) -> None:
        self._keep = keep
        self._owed: dict[str, bytes] = {}
        self._session = session
        self._topics = topics
        self._condition = threading.Condition()
        self._waiting: dict[str, Callable[[], Note]] = {}
        self._closed = False
        self._publishers: dict[str, zenoh.Publisher | zenoh.ext.AdvancedPublisher] = {}
        self._thread = start_watched("telemetry", self._publish, report)

    def offer(self, stream: str, make: Callable[[], Note]) -> None:
        """Have ``make()`` called on the telemetry thread, and its note published."""
        with self._condition:
            self._waiting[stream] = make
            self._condition.notify()

    def offer_json(self, stream: str, data: Mapping[str, object]) -> None:
        """Publish a mapping as JSON."""
        self.offer(stream, lambda: Note(json.dumps(data, separators=(",", ":")).encode()))

    def close(self) -> None:
        """Stop the thread; what waits is still sent."""
        with self._condition:
            self._closed = True
            self._condition.notify()
        self._thread.join(timeout=1.0)

    def _publish(self) -> None:
        while True:
            with self._condition:
                while not self._waiting and not self._closed:
                    self._condition.wait()
                waiting, self._waiting = self._waiting, {}
                closed = self._closed
            for stream, make in waiting.items():
                try:
                    if stream not in _ON_DEMAND or has_subscriber(self._publisher(stream)):
                        self._put(stream, make())
                except zenoh.ZError as error:
                    log.warning("telemetry %r not published: %s", stream, error)
            if closed:
                return

    def _put(self, stream: str, note: Note) -> None:
        self._copy(stream, note.payload if note.kept is None else note.kept)
        if stream in _NOT_PUBLISHED:
            return
        self._publisher(stream).put(
            note.payload, encoding=note.encoding, attachment=note.attachment
        )

    def _copy(self, stream: str, payload: bytes) -> None:
        """Give the black box what it keeps."""
        if stream in _KEPT:
            self._keep(stream, payload)
        elif stream in _KEPT_ONCE:
            self._owed[stream] = payload
        for owed in tuple(self._owed):
            if self._keep(owed, self._owed[owed]):
                del self._owed[owed]

    def _publisher(self, stream: str) -> zenoh.Publisher | zenoh.ext.AdvancedPublisher:
        if stream not in self._publishers:
            key = self._topics.telemetry(stream)
            drop = zenoh.CongestionControl.DROP
            self._publishers[stream] = (
                publish_kept(self._session, key)
                if stream in _CACHED
                else self._session.declare_publisher(key, congestion_control=drop)
            )
        return self._publishers[stream]
