"""Demos in real time, on machines that may be too busy or too slow for them.

Such a flight shows that the processes work together. How precisely they fly is judged in simulated
time, where no other load counts: here DONE near the goal is enough. The service refuses to fly
where frames cannot be compared in time, as it should: a flight is tried again, and where none
succeeds on a slow machine, no verdict is given.
"""

import json
import subprocess
import sys
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

import pytest

from dfvs_sim.demo.image_size import match_ms

ATTEMPTS = 3
SLOWEST_MS = 80.0
"""Of a match at 320 x 240: from there on even the smallest images come too late."""
NEAR_M, NEAR_DEG = 0.15, 5.0
FLIGHT_S = 280.0
SHARED = ("--size", "192x144", "--rate", "10")
"""Of each of two flights at the same time, as ``dfvs-demo --vehicles 2`` has it on two cores."""


def demo_command(folder: Path, *words: object) -> list[str]:
    """``dfvs-demo`` with results in a folder, patient with a busy machine."""
    patience = ("--ready", "90", "--timeout", "120")
    module = [sys.executable, "-m", "dfvs_sim.demo.cli", "--out", str(folder)]
    return [*module, *patience, *map(str, words)]


def ran(command: Sequence[str]) -> subprocess.CompletedProcess[str]:
    """The command, run to its end."""
    return subprocess.run(command, capture_output=True, text=True, timeout=FLIGHT_S, check=False)


def summaries(folder: Path) -> list[dict[str, Any]]:
    """Figures of the flights below a folder, by the simulated vehicles' true poses."""
    return [json.loads(path.read_text()) for path in sorted(folder.rglob("summary.json"))]


def is_near(summary: Mapping[str, Any]) -> bool:
    """Whether the service said DONE and the vehicle truly is near the goal."""
    m, deg = summary["final_translation_m"], summary["final_rotation_deg"]
    is_finite = m is not None and deg is not None
    is_done = summary["end_state"] == "DONE"
    return bool(is_done and is_finite and m < NEAR_M and deg < NEAR_DEG)


def flown_in_time(fly: Callable[[Path], Any], folder: Path, flights: int = 1) -> tuple[Any, Path]:
    """What ``fly`` returned and the folder it was given, once all flights in it ended near.

    Fails if they do in no attempt; skips on a machine too slow for as many at once.
    """
    for attempt in range(ATTEMPTS):
        place = folder / f"attempt-{attempt}"
        place.mkdir()
        flown, found = fly(place), summaries(place)
        if len(found) == flights and all(map(is_near, found)):
            return flown, place
    if (taken_ms := flights * match_ms()) > SLOWEST_MS:
        pytest.skip(f"no verdict: {taken_ms:.0f} ms a match, real time needs {SLOWEST_MS:g} ms")
    return pytest.fail(f"{flown}\n{found}")
