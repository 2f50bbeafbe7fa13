"""What a process holds of memory that it does not use."""

from __future__ import annotations

import ctypes


def give_back_memory() -> bool:
    """Hand free pages of the heap back to the system; tell whether there were any.

    glibc keeps what lies between blocks in use, so that a process holds the most that it ever
    needed at once, plus what fell between: over many goals that grows, slowly and without a leak.
    Takes a millisecond or two, and the next frames' first touch of a page as long again: for
    moments in which nothing moves. Elsewhere than on glibc it does nothing.
    """
    trim = getattr(ctypes.CDLL(None), "malloc_trim", None)
    return trim is not None and bool(trim(0))
