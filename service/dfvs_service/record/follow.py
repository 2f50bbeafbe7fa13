"""Subscription to one vehicle's frame records over Zenoh."""

import os
import time
from collections.abc import Iterator
from types import FrameType

from dfvs_common.progress import log
from dfvs_core.messages.topics import Topics
from dfvs_service.command import operators_zenoh
from dfvs_service.record.listener import Event, RecordListener
from dfvs_service.settings.config import ServiceConfig
from dfvs_service.zenoh_session import open_persistently, require_usable_files

_WAIT_S = 0.2
_DRAIN_S = 0.5
_CONNECT_PAUSE_S = 0.2
_NICENESS = 5


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
        # Whoever only looks must not take time from the flight.
        os.nice(_NICENESS)
        section = operators_zenoh(self._config.zenoh)
        session = open_persistently(section, lambda: self._stopped, log, _CONNECT_PAUSE_S)
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


def _rest(listener: RecordListener) -> Iterator[list[Event]]:
    """What is still under way."""
    deadline = time.monotonic() + _DRAIN_S
    while time.monotonic() < deadline and (events := listener.receive(_WAIT_S)):
        yield events
