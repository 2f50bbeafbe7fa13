"""Black box process."""

import os
import select
import socket
import time
from types import FrameType

from dfvs_common.lifecycle import ORPHANED
from dfvs_common.progress import warn
from dfvs_service.flight_feed import split_record
from dfvs_service.flights.black_box import BlackBox, Clock
from dfvs_service.flights.store import FlightStore, flights_folder
from dfvs_service.settings.config import ServiceConfig
from dfvs_service.settings.runtime import RuntimeFolder

_WAIT_S = 0.1
_UPDATE_NS = 200_000_000
_AFTERMATH_NS = 3_000_000_000
"""Without its parent the gate ends within this time, and has something to log until then."""
_MAX_DATAGRAM_BYTES = 1 << 20
_MOST_AT_ONCE = 64


class BlackBoxProcess:
    """Keeps a flight until it is told to stop, or until shortly after its parent is gone.

    Raises
    ------
    ConfigError
        If no folder of flights is known.
    OSError
        If the runtime folder cannot be used.
    """

    def __init__(self, config: ServiceConfig, runtime: RuntimeFolder) -> None:
        self._end_ns: int | None = None
        self._socket = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM)
        self._socket.setblocking(False)
        self._socket.bind(str(runtime.black_box_socket))
        clock = Clock(time.monotonic_ns, time.time_ns)
        store = FlightStore(flights_folder(config.black_box, os.environ))
        self._box = BlackBox(config, store, runtime, clock, warn)

    def stop(self, number: int, _frame: FrameType | None) -> None:
        """Signal handler: keep what has come, then end; a while later if the parent is gone."""
        self._end_ns = time.monotonic_ns() + (_AFTERMATH_NS if number == ORPHANED else 0)

    def run(self) -> None:
        """Keep the flight."""
        next_update_ns = 0
        while self._end_ns is None or time.monotonic_ns() < self._end_ns:
            now_ns = time.monotonic_ns()
            if now_ns >= next_update_ns:
                next_update_ns = now_ns + _UPDATE_NS
                self._box.update()
            self._receive(_WAIT_S)
        self._receive(0.0)
        self._box.close()
        self._socket.close()
        if self._box.dropped:
            warn(f"the black box lacks {self._box.dropped} records")

    def _receive(self, wait_s: float) -> None:
        """Take the records that have come; wait for the first one at most so long."""
        select.select([self._socket], [], [], wait_s)
        for _ in range(_MOST_AT_ONCE):
            try:
                datagram = self._socket.recv(_MAX_DATAGRAM_BYTES)
            except BlockingIOError:
                return
            self._box.add(*split_record(datagram))
