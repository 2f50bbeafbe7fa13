"""Reader of MCAP files, which may be cut off."""

import struct
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from mcap.exceptions import McapError
from mcap.records import Chunk, McapRecord
from mcap.stream_reader import StreamReader, breakup_chunk

from dfvs_core.errors import DfvsError

_MAX_RECORD_BYTES = 64 * 1024 * 1024
_CUT_SHORT = (McapError, struct.error, ValueError)
"""What mcap raises on bytes that are missing or wrong."""


class RecordingError(DfvsError):
    """A recording that cannot be used."""


@contextmanager
def open_records(path: Path) -> Iterator[Iterator[McapRecord]]:
    """Records of an MCAP file, chunks unfolded; ends quietly where the file was cut short.

    Raises
    ------
    RecordingError
        If the file cannot be read or is not MCAP at all.
    """
    try:
        file = path.open("rb")
    except OSError as error:
        raise RecordingError(f"cannot read {path} ({error.strerror})", "an MCAP file") from error
    with file:
        yield _records(
            StreamReader(file, emit_chunks=True, record_size_limit=_MAX_RECORD_BYTES), path
        )


def _records(reader: StreamReader, path: Path) -> Iterator[McapRecord]:
    any_read = False
    try:
        for record in reader.records:
            any_read = True
            if isinstance(record, Chunk):
                yield from _unfold(record)
            else:
                yield record
    except _CUT_SHORT as error:
        if not any_read:
            raise RecordingError(f"{path} is not a recording", "an MCAP file") from error


def _unfold(chunk: Chunk) -> list[McapRecord]:
    """Records of a chunk; McapError where it is not whole and unharmed by its checksum."""
    try:
        return breakup_chunk(chunk, validate_crc=True)
    except RuntimeError as error:  # what LZ4 says of data that are cut short
        raise McapError(str(error)) from error
