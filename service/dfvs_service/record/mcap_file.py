"""MCAP file whose finished chunks survive a crash."""

import contextlib
import os
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

from mcap.writer import CompressionType, Writer

from dfvs_service.record.messages.channels import Channel, Message

CHUNK_BYTES = 256 * 1024
_LIBRARY = "dfvs"
_UINT32 = 0xFFFFFFFF


class McapFile:
    """An MCAP file that is being written; any call may raise OSError.

    ``path`` must not exist; ``notes`` are metadata of the file, by name.
    """

    def __init__(self, path: Path, notes: Mapping[str, Mapping[str, str]]) -> None:
        self.path = path
        self._file = path.open("xb")
        self._channels: dict[Channel, int] = {}
        # LZ4 costs little and takes the JSON, not the images, to a quarter.
        # Half of mcap's methods carry no types.
        self._writer: Any = Writer(self._file, CHUNK_BYTES, CompressionType.LZ4)
        self._writer.start("", _LIBRARY)
        for name, note in notes.items():
            self._writer.add_metadata(name, dict(note))

    @property
    def size_bytes(self) -> int:
        """Size of the file, without the chunk that is being filled."""
        return self._file.tell()

    def write(self, messages: Iterable[Message]) -> None:
        """Append messages; they are in the file once their chunk is full, or after a flush."""
        for message in messages:
            self._writer.add_message(
                self._channel(message.channel),
                log_time=message.t_unix_ns,
                data=message.data,
                publish_time=message.t_unix_ns,
                sequence=message.sequence & _UINT32,
            )
        # From here on the chunks that are full outlive this process.
        self._file.flush()

    def flush(self) -> None:
        """End the chunk that is being filled."""
        self._writer.flush()

    def sync(self) -> None:
        """Have the disk keep what was written so far, should the power fail."""
        os.fdatasync(self._file.fileno())

    def finish(self) -> None:
        """Write the index and close."""
        try:
            self._writer.finish()
            self._file.flush()
            os.fdatasync(self._file.fileno())
        finally:
            self._file.close()

    def abandon(self) -> None:
        """Close as it is, without an index."""
        with contextlib.suppress(OSError):
            self._file.close()

    def _channel(self, channel: Channel) -> int:
        if channel not in self._channels:
            schema = 0
            if channel.schema_name:
                schema = self._writer.register_schema(
                    channel.schema_name, channel.schema_encoding, channel.schema
                )
            self._channels[channel] = self._writer.register_channel(
                channel.topic, channel.encoding, schema
            )
        return self._channels[channel]
