"""Recorder of MCAP files, each of which can be read by itself.

Never raises for want of a disk: what cannot be written is dropped and counted, and a new file is
tried every few seconds.
"""

import contextlib
import shutil
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from pathlib import Path

from dfvs_common.file_size import file_bytes
from dfvs_common.write_pause import WritePause
from dfvs_core.messages.frame_record import FrameRecord, SessionHeader
from dfvs_core.perception.flow_grid import FlowGrid
from dfvs_service.record.mcap_file import McapFile
from dfvs_service.record.messages.channels import Message
from dfvs_service.record.messages.translation import Translation
from dfvs_service.settings.record_sections import RecordSection

MB = 1_000_000
_SYNC_NS = 1_000_000_000


@dataclass(slots=True)
class RecordCounts:
    """What became of what was to be recorded.

    ``missing`` records never arrived, ``dropped`` ones could not be written, ``files_removed`` made
    room for newer ones.
    """

    records: int = 0
    missing: int = 0
    dropped: int = 0
    files_removed: int = 0


class Recorder:
    """Writes one recording.

    Files in ``folder``, which exists, are called ``NAME-000.mcap``, ``NAME-001.mcap``, ... ``tick``
    gives monotonic ns, and ``warn`` takes one line for the user.
    """

    def __init__(
        self,
        folder: Path,
        name: str,
        section: RecordSection,
        tick: Callable[[], int],
        warn: Callable[[str], None],
    ) -> None:
        self._folder = folder
        self._name = name
        self._file_bytes = round(min(section.max_file_mb, section.max_total_mb / 2) * MB)
        self._total_bytes = round(section.max_total_mb * MB)
        self._free_bytes = round(section.min_free_mb * MB)
        self._tick = tick
        self._warn = warn
        self._header: tuple[SessionHeader, bytes] | None = None
        self._translation: Translation | None = None
        self._file: McapFile | None = None
        self._written: list[Path] = []
        self._begun = 0
        self._next_record: int | None = None
        self._next_sync_ns = 0
        self._paused = WritePause()
        self.counts = RecordCounts()

    @property
    def path(self) -> Path | None:
        """File that is being written, None where none can be."""
        return None if self._file is None else self._file.path

    @property
    def size_bytes(self) -> int:
        """Size of the recording's files."""
        current = 0 if self._file is None else self._file.size_bytes
        return current + sum(map(file_bytes, self._written))

    def open(self, header: SessionHeader, image: bytes) -> None:
        """Take the session header that holds for the frame records to come."""
        if self._header is not None and header.run != self._header[0].run:
            self._next_record = header.first_turn
        self._header = (header, image)
        self._translation = Translation(header)
        if self._file is not None:
            self._write(self._translation.header(image), first=True)

    def add(self, record: FrameRecord, payload: bytes) -> None:
        """Add a frame record; one without its session header is dropped."""
        if self._translation is None:
            self.counts.dropped += 1
            return
        if self._next_record is not None and record.number > self._next_record:
            self.counts.missing += record.number - self._next_record
        self._next_record = record.number + 1
        if self._file is None and not self._begin():
            self.counts.dropped += 1
            return
        if self._write(self._translation.record(record, payload)):
            self.counts.records += 1
        else:
            self.counts.dropped += 1

    def add_flow(self, grid: FlowGrid) -> None:
        """Take the flow of a frame; for people only, so it is left out where there is no file."""
        if self._translation is not None:
            self._write([self._translation.flow(grid)])

    def close(self) -> None:
        """Bring the file that is being written to its end."""
        if self._file is None:
            return
        file, self._file = self._file, None
        try:
            file.finish()
        except OSError as error:
            self._warn(f"{file.path} could not be ended: {error.strerror}")
        self._written.append(file.path)

    # --- files ----------------------------------------------------------------------------

    def _write(self, messages: Iterable[Message], *, first: bool = False) -> bool:
        """Write to the file, and whatever is due then; returns whether that went well."""
        file, now_ns = self._file, self._tick()
        if file is None:
            return False
        try:
            file.write(messages)
            if first:
                file.flush()
            if now_ns >= self._next_sync_ns:
                self._next_sync_ns = now_ns + _SYNC_NS
                file.sync()
                if not self._has_room():
                    self.close()
                    self._pause(f"less than {self._free_bytes // MB} MB are free")
                    return True
        except OSError as error:
            self._pause(f"{self._folder}: {error.strerror}")
            return False
        if file.size_bytes >= self._file_bytes and not first:
            self.close()
        return True

    def _begin(self) -> bool:
        """Begin the next file; returns whether there is one."""
        if self._header is None or self._translation is None or self._paused.holds(self._tick()):
            return False
        if not self._has_room():
            self._pause(f"less than {self._free_bytes // MB} MB are free")
            return False
        header, image = self._header
        path = self._folder / f"{self._name}-{self._begun:03d}.mcap"
        try:
            self._file = McapFile(path, _notes(header))
        except OSError as error:
            self._pause(f"{self._folder}: {error.strerror}")
            return False
        self._begun += 1
        self._make_room()
        return self._write(self._translation.header(image), first=True)

    def _pause(self, why: str) -> None:
        """Write nothing for a while; what was written stays."""
        if self._paused.begin(why, self._tick()):
            self._warn(f"recording pauses: {why}")
        if self._file is not None:
            file, self._file = self._file, None
            file.abandon()
            if file_bytes(file.path):
                self._written.append(file.path)
            else:
                with contextlib.suppress(OSError):
                    file.path.unlink()
                    self._begun -= 1

    def _make_room(self) -> None:
        """Remove this recording's oldest files while it would grow beyond its limit."""
        while self._written and (
            sum(map(file_bytes, self._written)) + self._file_bytes > self._total_bytes
        ):
            with contextlib.suppress(OSError):
                self._written.pop(0).unlink()
            self.counts.files_removed += 1

    def _has_room(self) -> bool:
        try:
            return shutil.disk_usage(self._folder).free >= self._free_bytes
        except OSError:
            return False


def _notes(header: SessionHeader) -> dict[str, dict[str, str]]:
    """Metadata of a file: what somebody asks first who finds it."""
    return {
        "dfvs": {"vehicle": header.vehicle, "format": header.format},
        "dfvs.build": header.build,
        "dfvs.model": {"name": str(header.settings["flow"]["model"]), **header.model},
    }
