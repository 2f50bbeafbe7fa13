"""Heap preallocation, so that the heap does not grow in flight.

Arrays of an image's size come and go on several threads. When more of them coincide than before,
the end of the heap moves up and stays there. Figures are in ``docs/experiments/fuzzing.md``.

Python keeps up to 2000 tuples of every length for reuse; only a full collection frees them.
Perception asks for one every few seconds. It is quick, since objects of the start are frozen.
"""

import gc

import numpy as np

RESERVE_MB = 48
"""More than was ever seen in use at once above what perception starts with."""


def preallocate() -> None:
    """Take the memory that is needed later, and tell Python that what there is now stays.

    What is reserved stays resident as long as the C library keeps free memory, see
    ``dfvs_service.supervisor.child.STEADY_HEAP``.
    """
    gc.collect()
    gc.freeze()
    reserve = [np.ones(1 << 20, np.uint8) for _ in range(RESERVE_MB)]
    del reserve
