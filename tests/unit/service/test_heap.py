"""What is free in the middle of the heap goes back to the system."""

import sys

from dfvs_service.child import Child

HOLES = """
import resource, sys
import numpy as np
from dfvs_service.perception.heap import give_back_free_memory

def resident_mb():
    with open("/proc/self/statm") as file:
        return int(file.read().split()[1]) * resource.getpagesize() / 1e6

blocks = [np.ones(300_000, np.uint8) for _ in range(200)]
last = blocks.pop()
del blocks
before = resident_mb()
give_back_free_memory()
print(round(before - resident_mb()), last.sum(), file=sys.stderr)
"""


def test_holes_in_the_heap_are_given_back(tmp_path):
    child = Child((sys.executable, "-c", HOLES), tmp_path / "stderr")
    assert child.wait(20.0)
    (line,) = child.new_errors()
    given_back, kept = line.split()
    assert int(given_back) >= 50
    assert int(kept) == 300_000
