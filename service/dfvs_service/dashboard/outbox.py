"""What waits for one browser: the newest of everything, never a queue of old pictures."""

from __future__ import annotations

import asyncio
import enum
import struct
from collections.abc import Mapping, Sequence

MAX_ROWS = 512
MAX_UNSEEN = 2
"""Pictures under way that the browser has not confirmed: more would only grow old in buffers."""

_PERSONAL = frozenset({"welcome", "pong", "answers"})
"""News for this browser, whatever vehicle it watches."""

_PICTURE_HEADER = struct.Struct("<Bd")


class PictureKind(enum.IntEnum):
    """What a binary message holds, its first byte."""

    VIEW = 1
    GOAL = 2
    FLOW = 3


def encode_news(news: Mapping[str, str]) -> str:
    """One JSON object from keys and values that are JSON already."""
    return "{" + ",".join(f'"{key}":{value}' for key, value in news.items()) + "}"


def encode_picture(kind: PictureKind, t_ms: float, data: bytes) -> bytes:
    """Binary message: kind (1 byte), wall-clock time of capture (float64, ms), the data."""
    return _PICTURE_HEADER.pack(kind, t_ms) + data


class Outbox:
    """One slot for every kind of news and picture; rows of history are gathered in order.

    Used on the event loop's thread alone. Values are encoded once, by whoever offers them to all
    outboxes.
    """

    def __init__(self) -> None:
        self._news: dict[str, str] = {}
        self._rows: dict[str, list[str]] = {}
        self._pictures: dict[PictureKind, bytes] = {}
        self._ready = asyncio.Event()
        self._unseen = 0
        self.overtaken = 0
        """Pictures that were replaced by a newer one before they could be sent."""

    def offer(self, news: Mapping[str, str]) -> None:
        """Leave news (JSON by key), in place of older news of the same keys."""
        self._news.update(news)
        self._ready.set()

    def append(self, key: str, rows: Sequence[str]) -> None:
        """Leave rows (JSON) of a growing table; the oldest go where nobody fetches them."""
        kept = self._rows.setdefault(key, [])
        kept.extend(rows)
        del kept[:-MAX_ROWS]
        self._ready.set()

    def show(self, kind: PictureKind, message: bytes) -> None:
        """Leave a picture, in place of an older one of the same kind."""
        if kind is PictureKind.VIEW and kind in self._pictures:
            self.overtaken += 1
        self._pictures[kind] = message
        self._ready.set()

    def confirm(self) -> None:
        """The browser has received one view."""
        self._unseen = max(self._unseen - 1, 0)
        self._ready.set()

    def forget(self) -> None:
        """Drop what waits of vehicles: the browser turns to another one."""
        self._news = {key: value for key, value in self._news.items() if key in _PERSONAL}
        self._rows = {key: rows for key, rows in self._rows.items() if key in _PERSONAL}
        self._pictures.clear()

    async def next(self) -> tuple[str | None, list[bytes]]:
        """Text and pictures to be sent now; waits until there is something."""
        while not self._is_worth_sending():
            self._ready.clear()
            await self._ready.wait()
        return self._take_text(), self._take_pictures()

    def _is_worth_sending(self) -> bool:
        return bool(self._news or self._rows or self._sendable())

    def _sendable(self) -> list[PictureKind]:
        is_clogged = self._unseen >= MAX_UNSEEN
        return [k for k in self._pictures if k is not PictureKind.VIEW or not is_clogged]

    def _take_text(self) -> str | None:
        if not self._news and not self._rows:
            return None
        tables = {key: "[" + ",".join(rows) + "]" for key, rows in self._rows.items()}
        text = encode_news(self._news | tables)
        self._news.clear()
        self._rows.clear()
        return text

    def _take_pictures(self) -> list[bytes]:
        kinds = self._sendable()
        if PictureKind.VIEW in kinds:
            self._unseen += 1
        return [self._pictures.pop(kind) for kind in kinds]
