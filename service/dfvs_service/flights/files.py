"""File writers of a flight: append-only logs, copies of growing logs, bounded file series.

Whatever was appended outlives the process at once, and a power loss from the next ``sync`` on.
Every call may raise OSError, except where it says otherwise; an append that failed leaves no part
of it behind.
"""

import contextlib
import os
from collections import deque
from collections.abc import Iterator
from pathlib import Path

from dfvs_common.atomic_file import sync_folder, write_atomic

_SEGMENTS = 8
_CHUNK_BYTES = 1024 * 1024


class AppendFile:
    """A file that grows by whole records.

    An existing file is continued.
    """

    def __init__(self, path: Path) -> None:
        flags = os.O_WRONLY | os.O_CREAT | os.O_APPEND | os.O_CLOEXEC
        self._descriptor = os.open(path, flags, 0o600)
        self.size_bytes = os.fstat(self._descriptor).st_size
        self._is_synced = True
        sync_folder(path.parent)

    def append(self, data: bytes) -> None:
        """Add a record, or nothing of it."""
        left = memoryview(data)
        try:
            while left:
                left = left[os.write(self._descriptor, left) :]
        except OSError:
            with contextlib.suppress(OSError):
                os.ftruncate(self._descriptor, self.size_bytes)
            raise
        self.size_bytes += len(data)
        self._is_synced = False

    def sync(self) -> None:
        """Have the disk keep what was appended."""
        if not self._is_synced:
            os.fdatasync(self._descriptor)
            self._is_synced = True

    def close(self) -> None:
        """Close; never raises."""
        with contextlib.suppress(OSError):
            os.close(self._descriptor)


class _Log:
    """Log whose file is opened with its first record."""

    def __init__(self) -> None:
        self._file: AppendFile | None = None

    def sync(self) -> None:
        """Have the disk keep what was written."""
        if self._file is not None:
            self._file.sync()

    def close(self) -> None:
        """Close; never raises."""
        if self._file is not None:
            self._file.close()
            self._file = None


class LogCopy(_Log):
    """Copy of a log that another process writes: whole lines, up to a greatest size.

    ``source`` need not exist yet, and ``target`` is made with the first line. The copy ends before
    the first line that finds no room in ``max_bytes``.
    """

    def __init__(self, source: Path, target: Path, max_bytes: int) -> None:
        super().__init__()
        self._source = source
        self._target = target
        self.name = target.name
        self._max_bytes = max_bytes
        self.copied_bytes = 0
        self.is_full = False

    def update(self) -> None:
        """Copy the lines that were added since."""
        for lines in self._new_lines():
            if self.copied_bytes + len(lines) > self._max_bytes:
                room = self._max_bytes - self.copied_bytes
                lines = lines[: lines.rfind(b"\n", 0, room) + 1]
                self.is_full = True
            if self._file is None:
                self._file = AppendFile(self._target)
            self._file.append(lines)
            self.copied_bytes += len(lines)

    def _new_lines(self) -> Iterator[bytes]:
        """Whole lines that are not copied yet, in chunks."""
        while not self.is_full:
            try:
                with self._source.open("rb") as file:
                    file.seek(self.copied_bytes)
                    data = file.read(_CHUNK_BYTES)
            except FileNotFoundError:
                return
            end = data.rfind(b"\n") + 1
            if not end:
                return
            yield data[:end]


class SegmentedLog(_Log):
    """Append-only log in files ``STEM-000.jsonl``, ...; the oldest goes beyond a total size.

    ``folder`` exists and holds no such file; ``max_bytes`` is the size of all files together.
    """

    def __init__(self, folder: Path, stem: str, max_bytes: int) -> None:
        super().__init__()
        self._folder = folder
        self._stem = stem
        self._segment_bytes = max_bytes // _SEGMENTS
        self._paths: deque[Path] = deque()
        self._begun = 0

    def append(self, line: bytes) -> None:
        """Add a line, without its end."""
        record = line + b"\n"
        if len(record) > self._segment_bytes:
            return
        if self._file is None or self._file.size_bytes + len(record) > self._segment_bytes:
            self._begin()
        if self._file is not None:
            self._file.append(record)

    def _begin(self) -> None:
        path = self._folder / f"{self._stem}-{self._begun:03d}.jsonl"
        file = AppendFile(path)
        if self._file is not None:
            self._file.sync()
            self._file.close()
        self._file = file
        self._begun += 1
        self._paths.append(path)
        while len(self._paths) > _SEGMENTS:
            self._paths.popleft().unlink(missing_ok=True)


class FileRing:
    """Small files of one folder; the oldest go beyond a total size.

    ``folder`` is made with the first file; ``max_bytes`` is the size of all files together.
    """

    def __init__(self, folder: Path, max_bytes: int) -> None:
        self._folder = folder
        self._max_bytes = max_bytes
        self._files: deque[tuple[Path, int]] = deque()
        self._total_bytes = 0

    def add(self, name: str, data: bytes) -> None:
        """Write a file, whole or not at all; one that is larger than all may be is left out."""
        if len(data) > self._max_bytes:
            return
        self._folder.mkdir(exist_ok=True)
        while self._total_bytes + len(data) > self._max_bytes:
            path, size = self._files.popleft()
            self._total_bytes -= size
            path.unlink(missing_ok=True)
        write_atomic(self._folder / name, data)
        self._files.append((self._folder / name, len(data)))
        self._total_bytes += len(data)
