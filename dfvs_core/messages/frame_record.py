"""What a recorder is told: all that perception's results follow from, so that it can be rerun.

Two kinds of messages. An ``Opening`` says with what perception works: settings, goal, model, build.
A ``Turn`` is one round of perception's loop: what the gate had said, the sample as it came, the
times by which it was judged, and the report that followed. Same openings and turns, same
reports, bit for bit.
"""

from __future__ import annotations

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
class Opening:
    """With what perception works from the turn ``first_turn`` on.

    ``opened_ns`` is when it began to, and tells one opening from another. ``clock`` is the identity
    (hex) of the clock of all ``_ns``; ``unix_offset_ns`` added to them gives Unix time. ``build``
    maps software to versions, ``model`` the matcher's files to their SHA-256. ``settings`` are the
    service's resolved ones, ``sidecar`` the goal's; the goal's picture (PNG) travels beside the
    opening. ``observed_ns`` is the capture time of the earlier frame whose preview tracking began
    with, None where it began with a search.
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


@dataclass(frozen=True, slots=True)
class Sight:
    """The sample that a turn looked at; its payload travels beside the turn.

    ``attachment`` is the sample's, in hex. ``t_look_ns`` and ``t_servo_ns`` are the times by which
    the frame's age was judged: before decoding, and in the servo step (None where the frame did
    not get so far). ``stages_ns`` holds how long each stage took.
    """

    attachment: str
    t_arrival_ns: int
    t_look_ns: int
    t_servo_ns: int | None = None
    stages_ns: dict[str, int] = field(default_factory=dict)


@dataclass(frozen=True, slots=True)
class Turn:
    """One round of perception's loop.

    ``number`` counts from 0 without gaps, ``opening`` is the ``opened_ns`` of the one that holds.
    ``heard`` is what the gate said since the turn before, oldest first. ``sight`` is None where no
    frame came. ``servo`` is the frame's servo document, empty where there is none.
    """

    number: int
    opening: int
    t_ns: int
    heard: tuple[GateStatus, ...]
    report: PerceptionReport
    sight: Sight | None = None
    servo: dict[str, Any] = field(default_factory=dict)


def pack(message: Opening | Turn, payload: bytes) -> bytes:
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
