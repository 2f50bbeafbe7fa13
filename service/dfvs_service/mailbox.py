"""Mailbox between two threads that keeps the newest item only."""

import threading
from typing import Generic, TypeVar

T = TypeVar("T")


class Mailbox(Generic[T]):
    """Hands the newest item from one thread to another and forgets the older ones."""

    def __init__(self) -> None:
        self._condition = threading.Condition()
        self._item: T | None = None
        self.dropped = 0
        """How many items were replaced before anybody took them."""

    def put(self, item: T) -> None:
        """Leave an item, in place of one that was not taken."""
        with self._condition:
            if self._item is not None:
                self.dropped += 1
            self._item = item
            self._condition.notify()

    def get(self, timeout_s: float) -> T | None:
        """Take the newest item, waiting for one at most so long; None if none came."""
        with self._condition:
            if self._item is None:
                self._condition.wait(timeout_s)
            item, self._item = self._item, None
            return item
