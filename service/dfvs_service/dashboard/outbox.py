"""Outbox of one browser: the newest update of each kind."""

import asyncio
import enum
import struct
from collections.abc import Mapping, Sequence

MAX_ROWS = 512
MAX_UNSEEN = 2
"""Images under way that the browser has not confirmed: more would only grow old in buffers."""

_PERSONAL = frozenset({"welcome", "pong", "answers"})
"""Update for this browser, whatever vehicle it watches."""

_IMAGE_HEADER = struct.Struct("<Bd")


class ImageKind(enum.IntEnum):
    """What a binary message holds, its first byte."""

    VIEW = 1
    GOAL = 2
    FLOW = 3


def encode_image_message(kind: ImageKind, t_ms: float, data: bytes) -> bytes:
    """Binary message: kind (1 byte), wall-clock time of capture (float64, ms), the data."""
    return _IMAGE_HEADER.pack(kind, t_ms) + data


class Outbox:
    """One slot for every kind of update and image; rows of history are gathered in order.

    Used on the event loop's thread alone. Values are encoded once, by whoever offers them to all
    outboxes.
    """

    def __init__(self) -> None:
        self._update: dict[str, str] = {}
        self._rows: dict[str, list[str]] = {}
        self._images: dict[ImageKind, bytes] = {}
        self._ready = asyncio.Event()
        self._unseen = 0
        self.overtaken = 0
        """Images that were replaced by a newer one before they could be sent."""

    def offer(self, update: Mapping[str, str]) -> None:
        """Leave an update (JSON by key), in place of older values of the same keys."""
        self._update.update(update)
        self._ready.set()

    def append(self, key: str, rows: Sequence[str]) -> None:
        """Leave rows (JSON) of a growing table; the oldest go where nobody fetches them."""
        kept = self._rows.setdefault(key, [])
        kept.extend(rows)
        del kept[:-MAX_ROWS]
        self._ready.set()

    def show(self, kind: ImageKind, message: bytes) -> None:
        """Leave an image, in place of an older one of the same kind."""
        if kind is ImageKind.VIEW and kind in self._images:
            self.overtaken += 1
        self._images[kind] = message
        self._ready.set()

    def confirm(self) -> None:
        """The browser has received one view."""
        self._unseen = max(self._unseen - 1, 0)
        self._ready.set()

    def forget(self) -> None:
        """Drop what waits of vehicles: the browser turns to another one."""
        self._update = {key: value for key, value in self._update.items() if key in _PERSONAL}
        self._rows = {key: rows for key, rows in self._rows.items() if key in _PERSONAL}
        self._images.clear()

    async def next(self) -> tuple[str | None, list[bytes]]:
        """Text and images to be sent now; waits until there is something."""
        while not (self._update or self._rows or self._sendable()):
            self._ready.clear()
            await self._ready.wait()
        return self._next_text(), self._next_images()

    def _sendable(self) -> list[ImageKind]:
        is_clogged = self._unseen >= MAX_UNSEEN
        return [k for k in self._images if k is not ImageKind.VIEW or not is_clogged]

    def _next_text(self) -> str | None:
        if not self._update and not self._rows:
            return None
        tables = {key: "[" + ",".join(rows) + "]" for key, rows in self._rows.items()}
        members = [f'"{key}":{value}' for key, value in (self._update | tables).items()]
        self._update.clear()
        self._rows.clear()
        return "{" + ",".join(members) + "}"

    def _next_images(self) -> list[bytes]:
        kinds = self._sendable()
        if ImageKind.VIEW in kinds:
            self._unseen += 1
        return [self._images.pop(kind) for kind in kinds]
