"""Subscription to one vehicle's frame records over Zenoh."""

from __future__ import annotations

import contextlib
import os
import time
from collections.abc import Iterator
from types import FrameType

import zenoh

from dfvs_core.errors import ConfigError
from dfvs_core.messages.topics import Topics
from dfvs_service.command import operators_zenoh
from dfvs_service.record.listener import Event, RecordListener
from dfvs_service.settings.config import ServiceConfig
from dfvs_service.zenoh_session import open_session

_WAIT_S = 0.2
_DRAIN_S = 0.5
_CONNECT_PAUSE_S = 0.2
_NICENESS = 5


class Follower:
    """Follows a service, which may come and go, until told to stop."""

    def __init__(self, config: ServiceConfig) -> None:
        self._config = config
        self._stopped = False
        self.dropped = 0

    def stop(self, _signal: int, _frame: FrameType | None) -> None:
        """Signal handler: take what has come, then end."""
        self._stopped = True

    def events(self) -> Iterator[list[Event]]:
        """What has come, a few times a second also where nothing has."""
        # Whoever only looks must not take time from the flight.
        os.nice(_NICENESS)
        session = self._connect()
        if session is None:
            return
        with session:
            listener = RecordListener(session, Topics(self._config.vehicle.name))
            while not self._stopped:
                yield listener.receive(_WAIT_S)
                self.dropped = listener.dropped
            yield from _rest(listener)
            listener.close()
            self.dropped = listener.dropped

    def _connect(self) -> zenoh.Session | None:
        """Wait for the service, or its router, to be there; None if told to stop before."""
        section = operators_zenoh(self._config.zenoh)
        while not self._stopped:
            with contextlib.suppress(ConfigError):
                return open_session(section)
            time.sleep(_CONNECT_PAUSE_S)
        return None


def _rest(listener: RecordListener) -> Iterator[list[Event]]:
    """What is still under way."""
    deadline = time.monotonic() + _DRAIN_S
    while time.monotonic() < deadline and (events := listener.receive(_WAIT_S)):
        yield events
