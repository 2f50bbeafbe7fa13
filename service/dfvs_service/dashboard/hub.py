"""Distribution of vehicle models' updates to the browsers' outboxes.

Everything here runs on the event loop's thread; what arrives on other threads is handed over one
by one. Every message is encoded once, whatever the number of browsers.
"""

import json
import logging
from collections.abc import Callable, Iterable
from typing import Any

from dfvs_core.errors import DfvsError
from dfvs_core.messages.frame import NO_CLOCK
from dfvs_service.dashboard.outbox import ImageKind, Outbox, encode_image_message
from dfvs_service.dashboard.vehicles.clock import Moment
from dfvs_service.dashboard.vehicles.sample import BrowserImage, Sample
from dfvs_service.dashboard.vehicles.vehicle_links import MAX_VEHICLES
from dfvs_service.dashboard.vehicles.vehicle_model import Update, VehicleModel

_TABLES = frozenset({"servo", "path", "transitions"})

log = logging.getLogger("dfvs.dashboard")

Clock = Callable[[], Moment]
Watch = Callable[[frozenset[str]], None]


class Hub:
    """Takes samples, and leaves updates in the outboxes of those who watch the vehicle.

    ``on_watch`` is called with the vehicles that are watched by anybody, whenever they change.
    ``local_clock`` is the identity of this machine's monotonic clock.
    """

    def __init__(self, clock: Clock, on_watch: Watch, local_clock: bytes = NO_CLOCK) -> None:
        self._clock = clock
        self._local_clock = local_clock
        self._on_watch = on_watch
        self._models: dict[str, VehicleModel] = {}
        self._images: dict[str, dict[ImageKind, tuple[float, bytes]]] = {}
        """Newest image of each kind of a vehicle, with its time by the monotonic clock, ms."""
        self._watchers: dict[Outbox, str | None] = {}
        self.refused = 0
        """Messages from vehicles that could not be read."""

    @property
    def browsers(self) -> int:
        """How many pages are open."""
        return len(self._watchers)

    def model(self, vehicle: str) -> VehicleModel | None:
        """What is known of a vehicle, or None."""
        return self._models.get(vehicle)

    def join(self, outbox: Outbox) -> None:
        """Serve one more browser; it receives all vehicles' names, and watches none yet."""
        self._watchers[outbox] = None
        outbox.offer({"vehicles": self._vehicles_json()})

    def leave(self, outbox: Outbox) -> None:
        """Serve a browser no longer."""
        self._watchers.pop(outbox, None)
        self._publish_subscriptions()

    def watch(self, outbox: Outbox, vehicle: str) -> None:
        """Have a browser watch a vehicle: everything known of it is left in its outbox, once.

        A vehicle that is not known is passed over: the browser asks anew once it is listed.
        """
        model = self._models.get(vehicle)
        if model is None or self._watchers.get(outbox) == vehicle:
            return
        self._watchers[outbox] = vehicle
        outbox.forget()
        now = self._clock()
        news = {"watching": vehicle, **model.history(now), **model.link_update(now)}
        outbox.offer(_encode(news))
        outbox.offer({"vehicles": self._vehicles_json()})
        for kind, (t_ms, data) in self._images.get(vehicle, {}).items():
            outbox.show(kind, encode_image_message(kind, t_ms + now.offset_ms, data))
        self._publish_subscriptions()

    def on_samples(self, samples: Iterable[Sample]) -> None:
        """Take what came from vehicles; what does not follow its schema is counted and dropped."""
        for sample in samples:
            try:
                self._read(sample)
            except DfvsError as error:
                self.refused += 1
                log.debug("%s of %r not read: %s", sample.stream, sample.vehicle, error)
            except Exception:  # one sample must not cost the rest of its batch
                self.refused += 1
                log.exception("%s of %r not read", sample.stream, sample.vehicle)

    def tick(self, extra: Update) -> None:
        """Send vehicles and links to everybody; to be called once or twice a second."""
        now = self._clock()
        vehicles, common = self._vehicles_json(), _encode(extra)
        for outbox, vehicle in self._watchers.items():
            update = {"vehicles": vehicles, "overtaken": str(outbox.overtaken), **common}
            if vehicle is not None:
                update |= _encode(self._models[vehicle].link_update(now))
            outbox.offer(update)

    def _model_for(self, vehicle: str) -> VehicleModel | None:
        if vehicle not in self._models:
            if len(self._models) >= MAX_VEHICLES:
                return None
            self._models[vehicle] = VehicleModel(vehicle, self._local_clock)
        return self._models[vehicle]

    def _read(self, sample: Sample) -> None:
        model, now = self._model_for(sample.vehicle), self._clock()
        if model is None:
            return
        if isinstance(sample.content, BrowserImage):
            kind, data = sample.content.kind, sample.content.data
            t_ms = model.on_image(sample.stream, sample.content, now, sample.replaced)
            self._images.setdefault(model.name, {})[kind] = (t_ms - now.offset_ms, data)
            message = encode_image_message(kind, t_ms, data)
            for outbox in self._watching(model.name):
                outbox.show(kind, message)
        else:
            self._publish(model.name, model.on_document(sample.stream, sample.content, now))

    def _publish(self, vehicle: str, update: Update) -> None:
        outboxes = self._watching(vehicle)
        if not outboxes:
            return
        tables = {key: [_json(row) for row in update[key]] for key in update.keys() & _TABLES}
        rest = _encode({key: value for key, value in update.items() if key not in _TABLES})
        for outbox in outboxes:
            outbox.offer(rest)
            for key, rows in tables.items():
                outbox.append(key, rows)

    def _watching(self, vehicle: str) -> list[Outbox]:
        return [outbox for outbox, watched in self._watchers.items() if watched == vehicle]

    def _publish_subscriptions(self) -> None:
        self._on_watch(frozenset(name for name in self._watchers.values() if name is not None))

    def _vehicles_json(self) -> str:
        now = self._clock()
        return _json([model.listing(now) for _, model in sorted(self._models.items())])


def _json(value: Any) -> str:
    return json.dumps(value, separators=(",", ":"), allow_nan=False)


def _encode(update: Update) -> dict[str, str]:
    return {key: _json(value) for key, value in update.items()}
