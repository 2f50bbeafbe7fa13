"""Async bridge from Zenoh's threads to the event loop, in batches, newest image first.

A loop that is busy is given less to do, not more: images that it did not come to are replaced by
newer ones while they wait here.
"""

import asyncio
import dataclasses
import logging
import threading
from collections import deque
from collections.abc import Callable

from dfvs_core.errors import DfvsError
from dfvs_service.dashboard.vehicles.receiver import SHOWN
from dfvs_service.dashboard.vehicles.sample import Arrival, Sample, unpack

_MAX_DOCUMENTS = 1024
_PATIENCE_S = 1.0

log = logging.getLogger("dfvs.dashboard")


class AsyncBridge:
    """Unpacks arrivals on a thread of its own and hands them over in batches.

    ``on_samples`` takes a batch of samples, on the loop's thread.
    """

    def __init__(
        self, loop: asyncio.AbstractEventLoop, on_samples: Callable[[list[Sample]], None]
    ) -> None:
        self._loop = loop
        self._on_samples = on_samples
        self._condition = threading.Condition()
        self._images: dict[tuple[str, str], Arrival] = {}
        self._documents: deque[Arrival] = deque(maxlen=_MAX_DOCUMENTS)
        self._closed = False
        self._is_delivered = threading.Event()
        self._thread = threading.Thread(target=self._run, name="dashboard-bridge", daemon=True)
        self._thread.start()

    def deliver(self, arrival: Arrival) -> None:
        """Take an arrival, on any thread; returns at once."""
        with self._condition:
            if arrival.stream in SHOWN:
                key = arrival.vehicle, arrival.stream
                if (older := self._images.get(key)) is not None:
                    arrival = dataclasses.replace(arrival, replaced=older.replaced + 1)
                self._images[key] = arrival
            else:
                self._documents.append(arrival)
            self._condition.notify()

    def close(self) -> None:
        """Stop; what still waits is dropped."""
        with self._condition:
            self._closed = True
            self._condition.notify()
        self._is_delivered.set()
        self._thread.join(2.0)

    def _run(self) -> None:
        while (arrivals := self._collect()) is not None:
            samples = [sample for arrival in arrivals if (sample := _read(arrival)) is not None]
            self._is_delivered.clear()
            try:
                self._loop.call_soon_threadsafe(self._deliver_batch, samples)
            except RuntimeError:  # the loop has ended
                return
            self._is_delivered.wait(_PATIENCE_S)

    def _collect(self) -> list[Arrival] | None:
        """Everything that waits, documents first; None when closed."""
        with self._condition:
            self._condition.wait_for(lambda: self._closed or self._images or self._documents)
            if self._closed:
                return None
            arrivals = [*self._documents, *self._images.values()]
            self._documents.clear()
            self._images.clear()
            return arrivals

    def _deliver_batch(self, samples: list[Sample]) -> None:
        self._is_delivered.set()
        self._on_samples(samples)


def _read(arrival: Arrival) -> Sample | None:
    try:
        return unpack(arrival)
    except DfvsError as error:
        log.debug("%s of %r dropped: %s", arrival.stream, arrival.vehicle, error)
    except Exception:  # one arrival must not end the thread that reads all of them
        log.exception("%s of %r dropped", arrival.stream, arrival.vehicle)
    return None
