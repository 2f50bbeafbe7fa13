"""Waiting for what another thread or process does."""

import time
from collections.abc import Callable
from typing import TypeVar

Result = TypeVar("Result")


def until(condition: Callable[[], Result], timeout_s: float = 30.0, poll_s: float = 0.02) -> Result:
    """First true result of a condition, or the last one where none was true in time."""
    deadline = time.monotonic() + timeout_s
    while not (result := condition()) and time.monotonic() < deadline:
        time.sleep(poll_s)
    return result
