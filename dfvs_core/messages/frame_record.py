"""Frame records: the inputs and results of each frame, complete enough for a bit-exact replay.

A ``SessionHeader`` holds what perception works with: settings, goal, model, build. A
``FrameRecord`` holds one cycle of perception: the gate's messages since the last one, the sample as
received, the times by which its age was checked, and the report. The field names are the keys of
recordings; they stay, so that older recordings remain readable.
"""

import struct
from dataclasses import dataclass, field
from typing import Any, TypeVar

from dfvs_core.errors import ConfigError, WireError
from dfvs_core.messages.link import GateStatus, PerceptionReport
from dfvs_core.messages.schema import from_json, to_json

RECORD_FORMAT = "dfvs-record/1"

_HEAD = struct.Struct("<4sI")
_MAGIC = b"DFVT"

T = TypeVar("T")


@dataclass(frozen=True, slots=True)
class SessionHeader:
    """What perception works with from the frame record ``first_turn`` on.

    ``opened_ns`` is the time of its start, and identifies the header. ``clock`` is the identity
    (hex) of the clock of all ``_ns``; ``unix_offset_ns``, one for each run of perception, added to
    them gives Unix time. ``build`` maps software to versions, ``model`` the files of matcher and
    depth network to their SHA-256, those of the latter by ``depth/`` and their name. ``settings``
    are the service's resolved ones, ``sidecar`` the goal's; the goal image (PNG) travels beside it.
    ``observed_ns`` is the capture time of the earlier frame whose preview tracking began with,
    None where it began with a relocalisation.
    """

    vehicle: str
    first_turn: int
    opened_ns: int
    clock: str
    unix_offset_ns: int
    build: dict[str, str]
    model: dict[str, str]
    settings: dict[str, Any]
    sidecar: dict[str, Any]
    format: str = RECORD_FORMAT
    observed_ns: int | None = None

    def __post_init__(self) -> None:
        """Refuse another format."""
        if self.format != RECORD_FORMAT:
            raise ConfigError(f"the recording has the format {self.format!r}", repr(RECORD_FORMAT))

    @property
    def run(self) -> tuple[str, int]:
        """Identity of its run of perception, which all headers of that run share."""
        return self.clock, self.unix_offset_ns


@dataclass(frozen=True, slots=True)
class FrameInput:
    """Sample of a camera frame as received; its payload travels beside the record.

    ``attachment`` is the sample's, in hex. ``t_look_ns`` and ``t_servo_ns`` are the times by which
    the frame's age was checked: before decoding, and in the servo step (None where the frame did
    not get so far). ``stages_ns`` holds how long each stage took.
    """

    attachment: str
    t_arrival_ns: int
    t_look_ns: int
    t_servo_ns: int | None = None
    stages_ns: dict[str, int] = field(default_factory=dict)


@dataclass(frozen=True, slots=True)
class FrameRecord:
    """One cycle of perception.

    ``number`` counts from 0 without gaps, ``opening`` is the ``opened_ns`` of the valid header.
    ``heard`` holds the messages of the gate since the last record, oldest first. ``sight`` is None
    where no frame came. ``servo`` is the frame's servo document, empty where there is none.
    """

    number: int
    opening: int
    t_ns: int
    heard: tuple[GateStatus, ...]
    report: PerceptionReport
    sight: FrameInput | None = None
    servo: dict[str, Any] = field(default_factory=dict)


def pack(message: SessionHeader | FrameRecord, payload: bytes) -> bytes:
    """Bytes of a message with the bytes that travel beside it."""
    text = to_json(message)
    return b"".join((_HEAD.pack(_MAGIC, len(text)), text, payload))


def unpack(cls: type[T], data: bytes) -> tuple[T, bytes]:
    """Message of the given class, and the bytes beside it.

    Raises
    ------
    WireError
        If the bytes do not follow the format.
    """
    if len(data) < _HEAD.size:
        raise WireError(f"record of {len(data)} bytes", f"{_HEAD.size} or more")
    magic, length = _HEAD.unpack_from(data)
    end = _HEAD.size + length
    if magic != _MAGIC or end > len(data):
        raise WireError(f"record {magic!r} with {length} of {len(data)} bytes", f"{_MAGIC!r}")
    return from_json(cls, data[_HEAD.size : end]), data[end:]
