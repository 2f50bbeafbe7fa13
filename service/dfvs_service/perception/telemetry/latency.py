"""Durations of the stages between capture and report, as percentiles over recent frames."""

from collections import defaultdict, deque

import numpy as np

WINDOW = 300


class LatencyWindow:
    """The last durations of every stage."""

    def __init__(self) -> None:
        self._stages: defaultdict[str, deque[int]] = defaultdict(lambda: deque(maxlen=WINDOW))

    def add(self, stages_ns: dict[str, int]) -> None:
        """Take in one frame's durations, ns by stage."""
        for name, duration in stages_ns.items():
            self._stages[name].append(duration)

    def summary(self) -> dict[str, dict[str, float]]:
        """p50, p99 and max in ms by stage."""
        return {name: _percentiles(values) for name, values in self._stages.items()}


def _percentiles(values: deque[int]) -> dict[str, float]:
    p50, p99, most = np.percentile(np.array(values), [50, 99, 100]) * 1e-6
    return {
        "p50_ms": round(float(p50), 3),
        "p99_ms": round(float(p99), 3),
        "max_ms": round(float(most), 3),
    }
