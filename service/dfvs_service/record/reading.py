"""Reader of MCAP files, which may be cut off or damaged, and their repair."""

import struct
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from mcap.exceptions import McapError
from mcap.records import Channel, Chunk, McapRecord, Message, Metadata, Schema
from mcap.stream_reader import StreamReader, breakup_chunk
from mcap.writer import CompressionType, Writer

from dfvs_core.errors import DfvsError
from dfvs_service.record.mcap_file import CHUNK_BYTES

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


def recover(source: Path, target: Path, warn: Callable[[str], None]) -> int:
    """Copy all that can be read of a recording to a new, whole file; how many messages it holds.

    ``warn`` takes a line about what could not be read.

    Raises
    ------
    RecordingError
        If the source is no recording, or the target exists or cannot be written.
    """
    partial = target.with_name(target.name + ".part")
    if target.exists():
        raise RecordingError(f"{target} exists", "a name that is free")
    try:
        with open_records(source, warn) as records, partial.open("wb") as file:
            count = _copy(records, file)
        partial.rename(target)
    except OSError as error:
        raise RecordingError(f"cannot write {target} ({error.strerror})") from error
    finally:
        partial.unlink(missing_ok=True)
    return count


def _copy(records: Any, file: Any) -> int:
    # Half of mcap's methods carry no types.
    writer: Any = Writer(file, CHUNK_BYTES, CompressionType.LZ4)
    writer.start()
    schemas, channels = {0: 0}, {}
    count = 0
    for record in records:
        if isinstance(record, Schema) and record.id not in schemas:
            schemas[record.id] = writer.register_schema(record.name, record.encoding, record.data)
        elif isinstance(record, Channel) and record.id not in channels:
            if record.schema_id in schemas:  # else it was in a damaged chunk
                schema = schemas[record.schema_id]
                channels[record.id] = writer.register_channel(
                    record.topic, record.message_encoding, schema, record.metadata
                )
        elif isinstance(record, Metadata):
            writer.add_metadata(record.name, record.metadata)
        elif isinstance(record, Message) and record.channel_id in channels:
            count += 1
            writer.add_message(
                channels[record.channel_id],
                log_time=record.log_time,
                data=record.data,
                publish_time=record.publish_time,
                sequence=record.sequence,
            )
    writer.finish()
    return count
