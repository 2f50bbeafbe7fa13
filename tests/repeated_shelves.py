"""Equal shelves side by side, each with a mark of its own."""

from functools import cache

import numpy as np
from textured_wall import texture

PERIOD_PX = 80


@cache
def shelves(*marks):
    """View (240, 320, 3) uint8 of four shelves with the marks of these numbers; not to change."""
    shelf = texture(np.random.default_rng(40))[100:340, 100 : 100 + PERIOD_PX]
    view = np.tile(shelf, (1, len(marks), 1)).astype(np.uint8)
    for place, number in enumerate(marks):
        rng = np.random.default_rng(41 + number)
        top, left = rng.integers(20, 160), place * PERIOD_PX + rng.integers(5, 25)
        view[top : top + 48, left : left + 42] = texture(rng)[:48, :42]
    view.setflags(write=False)
    return view
