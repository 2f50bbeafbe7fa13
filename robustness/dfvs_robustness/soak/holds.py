"""Why the gate held: what camera and perception did in the half second before it.

A hold for an old frame is *true* where the simulated camera published none in time: no service
could have done better. Every other one is *false*.
"""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

MISSING_MS = 200.0
"""A gap between images that leaves too little of the gate's 250 ms to look at the next one."""
_LOOKED_AT_NS = 500_000_000


@dataclass(frozen=True, slots=True)
class Hold:
    """One change from SERVO to HOLD.

    ``camera_gap_ms`` is the longest time for which no image was published, ``seen_gap_ms`` that
    for which none was taken that perception took up, ``latency_ms`` the longest from capture to
    report.
    """

    cause: str
    camera_gap_ms: float
    seen_gap_ms: float
    latency_ms: float

    @property
    def is_false(self) -> bool:
        """Whether the camera had sent what was needed."""
        return self.camera_gap_ms < MISSING_MS


def explain(
    t_ns: int, cause: str, published_ns: Iterable[int], servo: Iterable[Mapping[str, Any]]
) -> Hold:
    """What led to a hold at ``t_ns`` (monotonic) with this cause.

    ``published_ns`` says when images were published, and ``servo`` is the telemetry of the frames,
    both in order.
    """
    begin_ns = t_ns - _LOOKED_AT_NS
    sent = [t for t in published_ns if begin_ns <= t <= t_ns]
    seen = [s for s in servo if begin_ns <= s["t_capture_ns"] <= t_ns]
    latencies = [float(s["stages_ms"].get("capture_to_report", 0.0)) for s in seen]
    return Hold(
        cause,
        _longest_ms([begin_ns, *sent, t_ns]),
        _longest_ms([begin_ns, *(s["t_capture_ns"] for s in seen), t_ns]),
        round(max(latencies, default=0.0), 1),
    )


def _longest_ms(times_ns: list[int]) -> float:
    return round(max((b - a for a, b in pairwise(times_ns)), default=0) * 1e-6, 1)
