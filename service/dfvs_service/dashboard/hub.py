"""Where vehicles and browsers meet: boards on one side, outboxes on the other.

Everything here runs on the event loop's thread; what arrives on other threads is handed over one
by one. Every message is encoded once, whatever the number of browsers.
"""

from __future__ import annotations

import json
import logging
from collections.abc import Callable, Iterable
from typing import Any

from dfvs_core.errors import DfvsError
from dfvs_service.dashboard.clock import Moment
from dfvs_service.dashboard.outbox import Outbox, PictureKind, encode_picture
from dfvs_service.dashboard.sample import Parcel, Picture
from dfvs_service.dashboard.vehicle_model import News, VehicleBoard

MAX_VEHICLES = 64

_TABLES = frozenset({"servo", "path", "transitions"})

log = logging.getLogger("dfvs.dashboard")

Clock = Callable[[], Moment]
Watch = Callable[[frozenset[str]], None]


class Hub:
    """Takes parcels, and leaves news in the outboxes of those who watch the vehicle.

    Parameters
    ----------
    clock : callable
        The present moment.
    on_watch : callable
        Told which vehicles are watched by anybody, whenever that changes.
    """

    def __init__(self, clock: Clock, on_watch: Watch) -> None:
        self._clock = clock
        self._on_watch = on_watch
        self._boards: dict[str, VehicleBoard] = {}
        self._pictures: dict[str, dict[PictureKind, bytes]] = {}
        """Newest picture of each kind of a vehicle."""
        self._watchers: dict[Outbox, str | None] = {}
        self.refused = 0
        """Messages from vehicles that could not be read."""

    @property
    def browsers(self) -> int:
        """How many pages are open."""
        return len(self._watchers)

    def board(self, vehicle: str) -> VehicleBoard | None:
        """What is known of a vehicle, or None."""
        return self._boards.get(vehicle)

    def join(self, outbox: Outbox) -> None:
        """Serve one more browser; it is told of all vehicles, and watches none yet."""
        self._watchers[outbox] = None
        outbox.offer({"vehicles": self._vehicles_json()})

    def leave(self, outbox: Outbox) -> None:
        """Serve a browser no longer."""
        self._watchers.pop(outbox, None)
        self._tell_watched()

    def watch(self, outbox: Outbox, vehicle: str) -> None:
        """Have a browser watch a vehicle: everything known of it is left in its outbox."""
        if (board := self._boards.get(vehicle)) is None:
            return
        self._watchers[outbox] = vehicle
        outbox.forget()
        links = board.link_news(self._clock())
        outbox.offer(_encode({"watching": vehicle, **board.history(), **links}))
        outbox.offer({"vehicles": self._vehicles_json()})
        for kind, picture in self._pictures.get(vehicle, {}).items():
            outbox.show(kind, picture)
        self._tell_watched()

    def take(self, parcels: Iterable[Parcel]) -> None:
        """Take what came from vehicles; what does not follow its schema is counted and dropped."""
        for parcel in parcels:
            try:
                self._read(parcel)
            except DfvsError as error:
                self.refused += 1
                log.debug("%s of %r not read: %s", parcel.stream, parcel.vehicle, error)

    def tick(self, extra: News) -> None:
        """Tell everybody of vehicles and links; to be called once or twice a second."""
        now = self._clock()
        vehicles, common = self._vehicles_json(), _encode(extra)
        for outbox, vehicle in self._watchers.items():
            news = {"vehicles": vehicles, "overtaken": str(outbox.overtaken), **common}
            if vehicle is not None:
                news |= _encode(self._boards[vehicle].link_news(now))
            outbox.offer(news)

    def _board_for(self, vehicle: str) -> VehicleBoard | None:
        if vehicle not in self._boards:
            if len(self._boards) >= MAX_VEHICLES:
                return None
            self._boards[vehicle] = VehicleBoard(vehicle)
        return self._boards[vehicle]

    def _read(self, parcel: Parcel) -> None:
        board, now = self._board_for(parcel.vehicle), self._clock()
        if board is None:
            return
        if isinstance(parcel.content, Picture):
            t_ms = board.see_picture(parcel.stream, parcel.content, now)
            message = encode_picture(parcel.content.kind, t_ms, parcel.content.data)
            self._pictures.setdefault(board.name, {})[parcel.content.kind] = message
            self._show(board.name, parcel.content.kind, message)
        else:
            self._tell(board.name, board.take(parcel.stream, parcel.content, now))

    def _tell(self, vehicle: str, news: News) -> None:
        outboxes = self._watching(vehicle)
        if not outboxes:
            return
        tables = {key: [_json(row) for row in news[key]] for key in news.keys() & _TABLES}
        rest = _encode({key: value for key, value in news.items() if key not in _TABLES})
        for outbox in outboxes:
            outbox.offer(rest)
            for key, rows in tables.items():
                outbox.append(key, rows)

    def _show(self, vehicle: str, kind: PictureKind, message: bytes) -> None:
        for outbox in self._watching(vehicle):
            outbox.show(kind, message)

    def _watching(self, vehicle: str) -> list[Outbox]:
        return [outbox for outbox, watched in self._watchers.items() if watched == vehicle]

    def _tell_watched(self) -> None:
        self._on_watch(frozenset(name for name in self._watchers.values() if name is not None))

    def _vehicles_json(self) -> str:
        return _json([board.listing() for _, board in sorted(self._boards.items())])


def _json(value: Any) -> str:
    return json.dumps(value, separators=(",", ":"), allow_nan=False)


def _encode(news: News) -> dict[str, str]:
    return {key: _json(value) for key, value in news.items()}
