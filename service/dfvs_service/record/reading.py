"""Reader of MCAP files, which may be cut off or damaged."""

import struct
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

from mcap.exceptions import McapError
from mcap.records import Chunk, McapRecord
from mcap.stream_reader import StreamReader, breakup_chunk

from dfvs_core.errors import DfvsError

_MAX_RECORD_BYTES = 64 * 1024 * 1024
_UNREADABLE = (McapError, struct.error, ValueError)
"""What mcap raises on bytes that are missing or wrong."""


class RecordingError(DfvsError):
    """A recording that cannot be used."""


class NotMcapError(RecordingError):
    """A file that is empty or of another kind."""


@contextmanager
def open_records(path: Path, warn: Callable[[str], None]) -> Iterator[Iterator[McapRecord]]:
    """Records of an MCAP file, chunks unfolded, as far as they are whole and unharmed.

    ``warn`` takes a line about damaged chunks, and one where the file ends early.

    Raises
    ------
    RecordingError
        If the file cannot be read; a NotMcapError if it is not MCAP at all.
    """
    try:
        file = path.open("rb")
    except OSError as error:
        raise RecordingError(f"cannot read {path} ({error.strerror})", "an MCAP file") from error
    with file:
        reader = StreamReader(file, emit_chunks=True, record_size_limit=_MAX_RECORD_BYTES)
        yield _records(reader, path, warn)


def _records(reader: StreamReader, path: Path, warn: Callable[[str], None]) -> Iterator[McapRecord]:
    any_read = False
    damaged = 0
    try:
        for record in reader.records:
            any_read = True
            if not isinstance(record, Chunk):
                yield record
            elif (unfolded := _unfold(record)) is not None:
                yield from unfolded
            else:
                damaged += 1
    except _UNREADABLE as error:
        if not any_read:
            raise NotMcapError(f"{path} is not a recording", "an MCAP file") from error
        warn(f"{path.name} ends early: it was cut off, or is damaged there")
    if damaged:
        warn(f"{path.name}: damaged chunks left out: {damaged}")


def _unfold(chunk: Chunk) -> list[McapRecord] | None:
    """Records of a chunk, None where it is not whole and unharmed by its checksum."""
    try:
        return breakup_chunk(chunk, validate_crc=True)
    except (*_UNREADABLE, RuntimeError):  # the latter is LZ4's
        return None
