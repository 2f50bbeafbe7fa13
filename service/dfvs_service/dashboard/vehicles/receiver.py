"""Zenoh subscriptions: telemetry of all vehicles, images of those that are watched.

It runs on a thread of its own, which opens the session (again and again until somebody is there)
and declares what is wanted. Samples come on Zenoh's threads and are handed on untouched.
"""

import logging
import re
import threading
from collections.abc import Callable
from typing import Any

import zenoh

from dfvs_core.errors import DfvsError
from dfvs_core.messages.topics import Topics
from dfvs_service.dashboard.vehicles.sample import Arrival
from dfvs_service.settings.sections import ZenohSection
from dfvs_service.zenoh_session import attachment_of, open_session, subscribe_kept

DOCUMENTS = ("state", "servo", "timing")
KEPT = ("config", "goal")
SHOWN = ("camera", "flow")

_RETRY_S = 0.5
_CLOSE_S = 10.0
"""So long a session may take to close: a thread that still uses it would abort the process."""
_CHECK_S = 1.0
_KEY = re.compile(r"dfvs/([^/]+)/([^/]+)")

log = logging.getLogger("dfvs.dashboard")


class Receiver:
    """Subscribes at one endpoint.

    ``deliver`` takes every arrival, on any thread, and must return at once.
    """

    def __init__(self, config: ZenohSection, deliver: Callable[[Arrival], None]) -> None:
        self.config = config
        self.is_connected = False
        self._deliver = deliver
        self._watched: frozenset[str] = frozenset()
        self._changed = threading.Event()
        self._stopped = False
        self._thread = threading.Thread(target=self._run, name="dashboard-zenoh", daemon=True)

    def start(self) -> None:
        """Begin to connect."""
        self._thread.start()

    def watch(self, vehicles: frozenset[str]) -> None:
        """Have frames and flow of exactly these vehicles delivered from now on."""
        self._watched = vehicles
        self._changed.set()

    def close(self) -> None:
        """Leave."""
        self._stopped = True
        self._changed.set()
        if self._thread.is_alive():
            self._thread.join(_CLOSE_S)

    def _run(self) -> None:
        last_error = ""
        while not self._stopped:
            try:
                with open_session(self.config) as session:
                    self._serve(session)
            except (DfvsError, zenoh.ZError) as error:
                self.is_connected = False
                if str(error) != last_error:
                    last_error = str(error)
                    log.info("not connected yet: %s", last_error)
                self._changed.wait(_RETRY_S)
                self._changed.clear()

    def _serve(self, session: zenoh.Session) -> None:
        """Keep the wanted subscriptions until told to stop; Zenoh itself reconnects."""
        always: list[Any] = [
            *(self._subscribe(session, f"dfvs/*/{stream}") for stream in DOCUMENTS),
            *(subscribe_kept(session, f"dfvs/*/{stream}", self._on_sample) for stream in KEPT),
        ]
        images: dict[str, list[zenoh.Subscriber[None]]] = {}
        while not self._stopped:
            self._changed.clear()
            watched = self._watched
            for name in images.keys() - watched:
                for subscriber in images.pop(name):
                    subscriber.undeclare()  # type: ignore[no-untyped-call]
            for name in watched - images.keys():
                keys = [f"dfvs/{name}/{stream}" for stream in SHOWN]
                images[name] = [self._subscribe(session, key) for key in keys]
            info = session.info
            self.is_connected = bool(info.routers_zid() or info.peers_zid())
            self._changed.wait(_CHECK_S)
        self.is_connected = False
        del always

    def _subscribe(self, session: zenoh.Session, key: str) -> zenoh.Subscriber[None]:
        return session.declare_subscriber(key, self._on_sample)

    def _on_sample(self, sample: zenoh.Sample) -> None:
        match = _KEY.fullmatch(str(sample.key_expr))
        if match is None or not _is_name(match[1]):
            return
        payload = sample.payload.to_bytes()
        self._deliver(Arrival(match[1], match[2], payload, attachment_of(sample)))


def _is_name(text: str) -> bool:
    try:
        Topics(text)
    except DfvsError:
        return False
    return True
