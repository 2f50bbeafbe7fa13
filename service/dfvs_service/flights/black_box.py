"""Writer of one flight's records.

Copies the logs that the processes write to the runtime folder, and keeps what they send. Nobody
waits for it. What cannot be written is dropped and counted, and tried again every few seconds;
the copies of the logs then catch up.
"""

import contextlib
import importlib.metadata
import json
import shutil
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import IO

from dfvs_common.atomic_file import sync_folder, write_atomic
from dfvs_common.write_pause import WritePause
from dfvs_service.flights import layout
from dfvs_service.flights.files import FileRing, LogCopy, SegmentedLog
from dfvs_service.flights.store import FlightStore, folder_bytes
from dfvs_service.settings.config import ServiceConfig
from dfvs_service.settings.runtime import RuntimeFolder

MB = 1_000_000
SYNC_NS = 1_000_000_000
"""A power loss costs at most what was written in this time."""

JSON_STREAMS = frozenset({"state", "servo", "timing", "route"})
_SENT_ONCE = frozenset({"goal", "route", "build"})
"""The newest record of each waits where it cannot be written."""


@dataclass(frozen=True, slots=True)
class Clock:
    """Readings of the monotonic and the Unix clock, ns."""

    monotonic_ns: Callable[[], int]
    unix_ns: Callable[[], int]


@dataclass(frozen=True, slots=True)
class _Parts:
    """Open files of a flight."""

    copies: tuple[LogCopy, ...]
    telemetry: SegmentedLog
    thumbnails: FileRing
    goals: FileRing

    def sync(self) -> None:
        """Have the disk keep what was written."""
        for copy in self.copies:
            copy.sync()
        self.telemetry.sync()

    def close(self) -> None:
        """Close all files; never raises."""
        for copy in self.copies:
            copy.close()
        self.telemetry.close()


class BlackBox:
    """Writes one flight; no call raises for want of a disk.

    ``warn`` takes one line for the user.
    """

    def __init__(
        self,
        config: ServiceConfig,
        store: FlightStore,
        runtime: RuntimeFolder,
        clock: Clock,
        warn: Callable[[str], None],
    ) -> None:
        self._config = config
        self._limits = config.black_box
        self._store = store
        self._runtime = runtime
        self._clock = clock
        self._warn = warn
        self._started_ns, self._started_unix_ns = clock.monotonic_ns(), clock.unix_ns()
        self._lock: IO[str] | None = None
        self._parts: _Parts | None = None
        self._next_sync_ns = self._started_ns
        self._paused = WritePause()
        self._owed: dict[str, tuple[int, bytes]] = {}
        self.folder: Path | None = None
        """Folder of the flight, None until it could be made."""
        self.dropped = 0
        """Records that could not be written."""

    def add(self, stream: str, payload: bytes) -> None:
        """Take a record: JSON of a telemetry stream or of the build, JPEG of a view or a goal."""
        now_ns = self._clock.monotonic_ns()
        if stream in _SENT_ONCE:
            self._owed[stream] = now_ns, payload
        if self._parts is None or self._paused.holds(now_ns):
            self.dropped += stream not in _SENT_ONCE
            return
        with self._unless_refused(records=stream not in _SENT_ONCE):
            self._keep(self._parts, stream, payload, now_ns)

    def _keep(self, parts: _Parts, stream: str, payload: bytes, t_ns: int) -> None:
        if stream in JSON_STREAMS:
            parts.telemetry.append(b'{"stream":"%s","data":%s}' % (stream.encode(), payload))
        elif stream == "thumbnail":
            parts.thumbnails.add(f"{t_ns}.jpg", payload)
        elif stream == "goal":
            parts.goals.add(f"{t_ns}.jpg", payload)
        elif stream == "build" and self.folder is not None:
            write_atomic(self.folder / layout.BUILD, payload)
        self._owed.pop(stream, None)

    def update(self) -> None:
        """Copy what the logs have grown by, and do what is due; to be called several times a s."""
        now_ns = self._clock.monotonic_ns()
        if self._paused.holds(now_ns):
            return
        with self._unless_refused():
            if self._parts is None:
                self._parts = self._begin()
            self._check_room()
            for copy in self._parts.copies:
                self._update(copy)
            for stream, (t_ns, payload) in tuple(self._owed.items()):
                self._keep(self._parts, stream, payload, t_ns)
            if now_ns >= self._next_sync_ns:
                self._next_sync_ns = now_ns + SYNC_NS
                self._parts.sync()

    def close(self) -> None:
        """Copy the rest and bring the flight to its end."""
        self._next_sync_ns = self._clock.monotonic_ns()
        self._paused.end(self._next_sync_ns)
        self.update()
        if self._parts is not None:
            self._parts.close()
        if self._lock is not None:
            self._lock.close()

    # --- disk -----------------------------------------------------------------------------

    @contextlib.contextmanager
    def _unless_refused(self, records: int = 0) -> Iterator[None]:
        """Pause where the disk refuses something; that many records are lost by it."""
        try:
            yield
        except OSError as error:
            self.dropped += records
            self._pause(error.strerror or str(error))

    def _pause(self, reason: str) -> None:
        """Write nothing for a while; what was written stays."""
        if self._paused.begin(reason, self._clock.monotonic_ns()):
            where = self._store.path if self.folder is None else self.folder
            at = time.strftime("%H:%M", time.gmtime(self._clock.unix_ns() * 1e-9))
            self._warn(
                f"the black box could not write to {where} at {at} UTC ({reason}) and tries again; "
                "the flight goes on"
            )

    def _begin(self) -> _Parts:
        """Make the flight's folder with all that is known at the start."""
        limits = self._limits
        if self.folder is None:
            self._store.make_room(round((limits.max_total_mb - limits.max_flight_mb) * MB))
            name_s = self._started_unix_ns * 1e-9
            self.folder, self._lock = self._store.create(self._config.vehicle.name, name_s)
        folder, runtime = self.folder, self._runtime
        self._check_room()
        header = {
            "format": layout.FORMAT,
            "vehicle": self._config.vehicle.name,
            "started_ns": self._started_ns,
            "started_unix_ns": self._started_unix_ns,
            "version": importlib.metadata.version("dfvs"),
        }
        write_atomic(folder / layout.HEADER, json.dumps(header).encode() + b"\n")
        write_atomic(folder / layout.SETTINGS, self._config.to_json().encode())
        for image_path in (runtime.goal_image, *runtime.later_goals()):
            for source in (image_path, image_path.with_suffix(".json")):
                write_atomic(folder / source.name, source.read_bytes())
        sync_folder(self._store.path)
        return self._open_parts(folder)

    def _open_parts(self, folder: Path) -> _Parts:
        """Every part has its share of the flight's size."""
        runtime, limit = self._runtime, round(self._limits.max_flight_mb * MB)
        whole = max(limit - folder_bytes(folder), 0)
        small = whole // 50
        logs = {
            runtime.gate_inputs: (layout.GATE_INPUTS, whole * 2 // 5),
            runtime.gate_log: (layout.GATE_LOG, small),
            runtime.service_log: (layout.SERVICE_LOG, small),
        }
        logs |= {path: (path.name, small) for path in runtime.stderr_files()}
        return _Parts(
            tuple(LogCopy(source, folder / name, size) for source, (name, size) in logs.items()),
            SegmentedLog(folder, layout.TELEMETRY, whole // 4),
            FileRing(folder / layout.THUMBNAILS, whole // 10),
            FileRing(folder / layout.GOALS, whole // 20),
        )

    def _update(self, copy: LogCopy) -> None:
        was_full = copy.is_full
        copy.update()
        if copy.is_full and not was_full:
            self._warn(f"the black box keeps no more of {copy.name}: it is as large as it may be")

    def _check_room(self) -> None:
        """Refuse to fill the disk: OSError where too little is free."""
        if self.folder is not None:
            free = shutil.disk_usage(self.folder).free
            if free < self._limits.min_free_mb * MB:
                raise OSError(f"less than {self._limits.min_free_mb:g} MB are free")
