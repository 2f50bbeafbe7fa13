"""All the memory that a flight needs, taken before it, as real-time programs do.

Arrays of a picture's size come and go on several threads, between objects that stay. Now and then
more of them coincide than ever before, the heap's end moves up, and something small stays behind at
its top: in half an hour of flights that were steps of 1 MB, with nothing more in use. Giving free
pages back did not help, since all of them were in use again within seconds (and cost 10 ms of page
faults in the next frame); nor did a mapping of its own for each array (60 % more time per tracked
frame).

Python itself keeps up to 2000 tuples of every length for later; only a full collection lets them
go, and a process that leaves no garbage sees the first one after a quarter of an hour. Perception
asks for one every few seconds, which is quick: what was there from the start is not looked at.
"""

from __future__ import annotations

import gc

import numpy as np

RESERVE_MB = 48
"""More than was ever seen in use at once above what perception starts with."""


def settle() -> None:
    """Take the memory that is needed later, and tell Python that what there is now stays.

    What is reserved stays resident as long as the C library keeps free memory, see
    ``dfvs_service.child.STEADY_HEAP``.
    """
    gc.collect()
    gc.freeze()
    reserve = [np.ones(1 << 20, np.uint8) for _ in range(RESERVE_MB)]
    del reserve
