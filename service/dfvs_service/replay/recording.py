"""Reader of session headers and frame records from a recording's files."""

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from foxglove_schemas_protobuf.CompressedImage_pb2 import CompressedImage
from foxglove_schemas_protobuf.RawImage_pb2 import RawImage
from google.protobuf.message import DecodeError
from mcap.records import Channel, Message

from dfvs_common.file_order import numbered
from dfvs_common.progress import log
from dfvs_core.errors import WireError
from dfvs_core.gate.config import S
from dfvs_core.messages.frame_record import FrameRecord, SessionHeader
from dfvs_core.messages.link import GateStatus
from dfvs_core.messages.schema import from_json
from dfvs_service.flights.records import StateChange
from dfvs_service.record.messages import channels
from dfvs_service.record.reading import NotMcapError, RecordingError, open_records

_BETWEEN_RUNS_NS = 1 * S
"""A run is shown so long after the one before, however long the time between them was."""


@dataclass(frozen=True, slots=True)
class Run:
    """One run of the service in a recording, which holds several after a restart or a reboot.

    ``opened_ns`` is its begin on its own monotonic clock, ``unix_ns`` that in Unix time. In times
    of the recording it begins at ``from_ns``, shortly after the end of the run before.
    """

    opened_ns: int = 0
    unix_ns: int = 0
    from_ns: int = 0

    @property
    def start_ns(self) -> int:
        """Time 0 of the recording on the clock of this run."""
        return self.opened_ns - self.from_ns

    def seconds(self, t_ns: int) -> float:
        """Time of the recording, s, at a time of this run's clock."""
        return (t_ns - self.start_ns) / S


@dataclass(frozen=True, slots=True)
class Entry:
    """Session header or frame record, its bytes, and its run of the service.

    The bytes are a goal's PNG, or a sample's payload.
    """

    message: SessionHeader | FrameRecord
    payload: bytes | None = None
    run: Run = Run()

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
        Takes a line about what is left out of a file: damaged, or repeated.

    Raises
    ------
    RecordingError
        If a file cannot be read or is no recording of a flight, or the files are of two vehicles.
    """
    yield from _in_runs(_of_one_vehicle(_once(paths, warn)))


def _once(paths: Sequence[Path], warn: Callable[[str], None]) -> Iterator[Entry]:
    """Entries of the files without what is repeated."""
    newest: dict[int, int] = {}  # number of the newest frame record of each session header
    for path in in_order(paths):
        repeated = headless = 0
        for entry in _entries(path, warn):
            message = entry.message
            if isinstance(message, SessionHeader):
                if message.opened_ns in newest:
                    continue
                newest[message.opened_ns] = -1
            elif message.opening not in newest:
                headless += 1
                continue
            elif message.number <= newest[message.opening]:
                repeated += 1
                continue
            else:
                newest[message.opening] = message.number
            yield entry
        if repeated:
            warn(f"{path.name}: {repeated} frame records that other files hold are left out")
        if headless:
            warn(f"{path.name}: frame records without their session header left out: {headless}")
    if not newest:
        raise RecordingError(
            f"{paths[0]} is not a recording of a flight, or its session header is damaged",
            "a file of dfvs-record",
        )


def _of_one_vehicle(entries: Iterable[Entry]) -> Iterator[Entry]:
    """Entries as they are; RecordingError where another vehicle's follow."""
    vehicle = ""
    for entry in entries:
        if isinstance(entry.message, SessionHeader):
            vehicle = vehicle or entry.message.vehicle
            if entry.message.vehicle != vehicle:
                raise RecordingError(
                    f"the files are of {vehicle} and of {entry.message.vehicle}",
                    "the files of one vehicle",
                )
        yield entry


def _in_runs(entries: Iterable[Entry]) -> Iterator[Entry]:
    """Entries with the run that each belongs to."""
    run, identity, end_ns = Run(), None, None
    for entry in entries:
        message = entry.message
        if isinstance(message, FrameRecord):
            end_ns = message.t_ns
        elif message.run != identity:
            from_ns = 0 if end_ns is None else end_ns - run.start_ns + _BETWEEN_RUNS_NS
            identity, end_ns = message.run, message.opened_ns
            run = Run(end_ns, end_ns + message.unix_offset_ns, from_ns)
        yield replace(entry, run=run)


def in_order(paths: Sequence[Path]) -> list[Path]:
    """Files in the order of their names, wherever they lie, a repaired copy after its original."""
    return sorted(paths, key=lambda path: (numbered(path), path.parent))


def _entries(path: Path, warn: Callable[[str], None]) -> Iterator[Entry]:
    """Whole entries of a file; none where a power cut left it empty."""
    try:
        yield from (entry for entry in _all_entries(path, warn) if entry.is_whole)
    except NotMcapError as error:
        warn(f"{error.problem}: left out")


def _all_entries(path: Path, warn: Callable[[str], None]) -> Iterator[Entry]:
    """Entries of a file, in its order."""
    topics: dict[int, str] = {}
    entry: Entry | None = None
    with open_records(path, warn) as records:
        for record in records:
            if isinstance(record, Channel):
                topics[record.id] = record.topic
            if not isinstance(record, Message):
                continue
            topic = topics.get(record.channel_id, "")
            if topic in _MESSAGES:
                if entry is not None:
                    yield entry
                entry = _begin(path, topic, record.data)
            elif topic in _PAYLOADS and entry is not None:
                entry = replace(entry, payload=_payload(topic, record.data))
    if entry is not None:
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
            f"{path} was made by another version: {error.problem}", "a recording of this version"
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
    """Changes of the gate's state, from its statuses."""

    def __init__(self) -> None:
        self.changes: list[StateChange] = []
        self._last: tuple[Run, str, int] | None = None

    def add(self, status: GateStatus, run: Run) -> None:
        """Take the gate's next status, of a run; a state is entered in the run at the earliest."""
        last, self._last = self._last, (run, status.state, status.since_ns)
        if self._last != last:
            t_s = run.seconds(max(status.since_ns, run.opened_ns))
            self.changes.append(StateChange(t_s, status.state, status.cause, ""))
