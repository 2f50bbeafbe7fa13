"""Memory that a flight needs is resident before it begins, and stays."""

import sys

from dfvs_service.perception.preallocation import RESERVE_MB
from dfvs_service.supervisor.child import Child

FLIGHT = """
import gc, resource, sys
import numpy as np
from dfvs_service.perception.preallocation import preallocate

def resident_mb():
    with open("/proc/self/statm") as file:
        return int(file.read().split()[1]) * resource.getpagesize() / 2**20

before = resident_mb()
preallocate()
settled = resident_mb()
blocks = [np.ones(300_000, np.uint8) for _ in range(100)]
flying = resident_mb()
last = blocks.pop()
del blocks
print(round(settled - before), round(flying - settled), round(resident_mb() - settled),
      gc.get_freeze_count() > 0, last.sum(), file=sys.stderr)
"""


def test_a_flight_takes_no_memory_that_was_not_reserved(tmp_path):
    child = Child((sys.executable, "-c", FLIGHT), tmp_path / "stderr")
    assert child.wait(60.0)
    (line,) = child.new_errors()
    reserved, taken, left, frozen, kept = line.split()
    assert RESERVE_MB - 2 <= int(reserved) <= RESERVE_MB + 5
    assert abs(int(taken)) <= 1
    assert abs(int(left)) <= 1
    assert frozen == "True"
    assert int(kept) == 300_000
