"""Make a failing list short: leave out what is not needed for the failure (delta debugging)."""

from collections.abc import Callable
from typing import TypeVar

T = TypeVar("T")


def shrink_list(items: list[T], fails: Callable[[list[T]], bool]) -> list[T]:
    """Leave out parts, then single items, as long as what is left still fails.

    Parameters
    ----------
    items : list
        Which fails.
    fails : callable
        Tells whether a list fails.
    """
    size = max(len(items) // 2, 1)
    while True:
        start, shortened = 0, False
        while start < len(items):
            rest = items[:start] + items[start + size :]
            if fails(rest):
                items, shortened = rest, True
            else:
                start += size
        if size == 1 and not shortened:
            return items
        size = max(size // 2, 1)
