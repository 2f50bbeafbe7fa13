"""The recorder as a process of its own: Zenoh in, MCAP files out, nobody waits for it."""

from __future__ import annotations

import contextlib
import os
import signal
import sys
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from types import FrameType

import zenoh

from dfvs_core.errors import ConfigError
from dfvs_core.topics import Topics
from dfvs_core.wire.turn import Opening
from dfvs_service.config import RecordSection, ServiceConfig
from dfvs_service.orders import operators_zenoh
from dfvs_service.record.listener import TurnListener
from dfvs_service.record.recorder import MB, RecordCounts, Recorder, RecordLimits
from dfvs_service.zenoh_session import open_session

_WAIT_S = 0.2
_DRAIN_S = 0.5
_CONNECT_PAUSE_S = 0.2
_NICENESS = 10


@dataclass(frozen=True, slots=True)
class RecordSummary:
    """What a recording came to."""

    folder: str
    name: str
    size_bytes: int
    counts: RecordCounts


def limits_of(section: RecordSection) -> RecordLimits:
    """Limits in bytes, from the settings' MB."""
    return RecordLimits(
        round(section.max_file_mb * MB),
        round(section.max_total_mb * MB),
        round(section.min_free_mb * MB),
    )


class RecordProcess:
    """Records one vehicle until it is told to stop, or until its parent is gone."""

    def __init__(self, config: ServiceConfig, folder: Path) -> None:
        self._config = config
        self._stopped = False
        self._parent = os.getppid()
        stamp = time.strftime("%Y%m%dT%H%M%SZ", time.gmtime())
        self._name = f"{config.vehicle.name}-{stamp}"
        self._folder = folder
        limits = limits_of(config.record)
        self._recorder = Recorder(folder, self._name, limits, time.monotonic_ns, _warn)

    def stop(self, _signal: int, _frame: FrameType | None) -> None:
        """Signal handler: write what has come, then end."""
        self._stopped = True

    def run(self, show: Callable[[Recorder], None]) -> RecordSummary:
        """Record; ``show`` is called a few times a second.

        Raises
        ------
        ConfigError
            If Zenoh's settings are wrong.
        """
        # A recorder must not take time from the flight that it records.
        os.nice(_NICENESS)
        session = self._connect()
        if session is not None:
            with session:
                listener = TurnListener(session, Topics(self._config.vehicle.name))
                while self._goes_on:
                    self._take(listener, _WAIT_S)
                    show(self._recorder)
                self._drain(listener)
                listener.close()
                self._recorder.counts.missing += listener.dropped
        summary = RecordSummary(
            str(self._folder), self._name, self._recorder.size_bytes, self._recorder.counts
        )
        self._recorder.close()
        return summary

    @property
    def _goes_on(self) -> bool:
        return not self._stopped and os.getppid() == self._parent

    def _connect(self) -> zenoh.Session | None:
        """Wait for the service, or its router, to be there; None if told to stop before."""
        section = operators_zenoh(self._config.zenoh)
        while self._goes_on:
            with contextlib.suppress(ConfigError):
                return open_session(section)
            time.sleep(_CONNECT_PAUSE_S)
        return None

    def _take(self, listener: TurnListener, wait_s: float) -> bool:
        """Write what has come; tell whether anything had."""
        events = listener.take(wait_s)
        for message, payload in events:
            if isinstance(message, Opening):
                self._recorder.open(message, payload)
            else:
                self._recorder.add(message, payload)
        return bool(events)

    def _drain(self, listener: TurnListener) -> None:
        """Take what is still under way."""
        deadline = time.monotonic() + _DRAIN_S
        while self._take(listener, _WAIT_S) and time.monotonic() < deadline:
            pass


def handle_signals(process: RecordProcess) -> None:
    """End in an orderly way on Ctrl-C, SIGTERM and a closed terminal."""
    for number in (signal.SIGTERM, signal.SIGINT, signal.SIGHUP):
        signal.signal(number, process.stop)


def _warn(line: str) -> None:
    print(f"warning: {line}", file=sys.stderr, flush=True)
