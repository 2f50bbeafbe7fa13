"""Repair of the index of a recording that was cut off."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

from mcap.records import Channel, Message, Metadata, Schema
from mcap.writer import CompressionType, Writer

from dfvs_service.record.mcap_file import CHUNK_BYTES
from dfvs_service.record.reading import RecordingError, open_records


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
