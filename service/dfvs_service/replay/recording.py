"""Reader of session headers and frame records from a recording's files."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from foxglove_schemas_protobuf.CompressedImage_pb2 import CompressedImage
from foxglove_schemas_protobuf.RawImage_pb2 import RawImage
from google.protobuf.message import DecodeError
from mcap.records import Channel, Message

from dfvs_common.progress import log
from dfvs_core.errors import WireError
from dfvs_core.gate.config import S
from dfvs_core.messages.frame_record import FrameRecord, SessionHeader
from dfvs_core.messages.link import GateStatus
from dfvs_core.messages.schema import from_json
from dfvs_service.flights.records import StateChange
from dfvs_service.record.messages import channels
from dfvs_service.record.reading import RecordingError, open_records


@dataclass(frozen=True, slots=True)
class Entry:
    """Session header or frame record, and its bytes: a goal's PNG, or a sample's payload."""

    message: SessionHeader | FrameRecord
    payload: bytes | None = None

    @property
    def is_whole(self) -> bool:
        """Whether the bytes that belong to it were found."""
        needs = isinstance(self.message, SessionHeader) or self.message.sight is not None
        return self.payload is not None or not needs


def read_recording(paths: Sequence[Path], warn: Callable[[str], None] = log) -> Iterator[Entry]:
    """Entries of a recording's files in order; what is repeated comes once.

    Every file begins with a session header, and a repaired copy repeats the frame records of its
    original.

    Parameters
    ----------
    paths : sequence of Path
        Files of the recording, in any order.
    warn : callable
        Takes a line about each file whose frame records are repeated.

    Raises
    ------
    RecordingError
        If a file cannot be read, or is no recording of a flight.
    """
    newest: dict[int, int] = {}  # number of the newest frame record of each session header
    for path in in_order(paths):
        repeated = 0
        for entry in _entries(path):
            message = entry.message
            if isinstance(message, SessionHeader):
                if message.opened_ns in newest:
                    continue
                newest[message.opened_ns] = -1
            elif not newest:
                raise RecordingError(
                    f"{path} holds frame records without a session header", "a whole recording"
                )
            elif message.number <= newest.get(message.opening, -1):
                repeated += 1
                continue
            else:
                newest[message.opening] = message.number
            yield entry
        if repeated:
            warn(f"{path.name}: {repeated} frame records that other files hold are left out")
    if not newest:
        raise RecordingError(f"{paths[0]} holds no flight", "a file of dfvs-record")


def in_order(paths: Sequence[Path]) -> list[Path]:
    """Files of a recording in the order of their names, a repaired copy after its original."""
    return sorted(paths, key=lambda path: path.with_suffix(""))


def _entries(path: Path) -> Iterator[Entry]:
    """Whole entries of a file, in its order."""
    topics: dict[int, str] = {}
    entry: Entry | None = None
    with open_records(path) as records:
        for record in records:
            if isinstance(record, Channel):
                topics[record.id] = record.topic
            if not isinstance(record, Message):
                continue
            topic = topics.get(record.channel_id, "")
            if topic in _MESSAGES:
                if entry is not None and entry.is_whole:
                    yield entry
                entry = _begin(path, topic, record.data)
            elif topic in _PAYLOADS and entry is not None:
                entry = replace(entry, payload=_payload(topic, record.data))
    if entry is not None and entry.is_whole:
        yield entry


_MESSAGES: dict[str, type[SessionHeader] | type[FrameRecord]] = {
    channels.SESSION_HEADER.topic: SessionHeader,
    channels.FRAME_RECORD.topic: FrameRecord,
}
_PAYLOADS = {
    channels.GOAL_IMAGE.topic: CompressedImage,
    channels.COMPRESSED_IMAGE.topic: CompressedImage,
    channels.RAW_IMAGE.topic: RawImage,
    channels.UNREADABLE.topic: None,
}


def _begin(path: Path, topic: str, data: bytes) -> Entry:
    try:
        return Entry(from_json(_MESSAGES[topic], data))
    except WireError as error:
        raise RecordingError(
            f"{path} was made by another version: {error.problem}",
            "a recording of this version",
        ) from error


def _payload(topic: str, data: bytes) -> bytes | None:
    image = _PAYLOADS[topic]
    if image is None:
        return data
    try:
        return image.FromString(data).data
    except DecodeError:
        return None


class StateLog:
    """Changes of the gate's state, from its statuses.

    Parameters
    ----------
    start_ns : int
        Time 0 of the changes.
    """

    def __init__(self, start_ns: int) -> None:
        self.start_ns = start_ns
        self.changes: list[StateChange] = []

    def add(self, status: GateStatus) -> None:
        """Take the gate's next word."""
        if not self.changes or status.state != self.changes[-1].state:
            t_s = max(status.since_ns - self.start_ns, 0) / S
            self.changes.append(StateChange(t_s, status.state, status.cause, ""))
