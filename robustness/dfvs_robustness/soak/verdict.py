"""What the samples of a soak come to: growth, robustly, and how well that is known."""

from dataclasses import dataclass

import numpy as np

from dfvs_core.geometry.arrays import FloatArray
from dfvs_robustness.soak.sampling import Sample

MAX_MB_PER_H = 1.0
WARM_UP_SHARE = 0.25
"""Caches fill, pools grow: the first part does not count."""
LONGEST_WARM_UP_S = 300.0
_BLOCKS = 24
_Z95 = 1.96


@dataclass(frozen=True, slots=True)
class Slope:
    """Growth per unit of time, and its 95 % confidence interval."""

    value: float
    low: float
    high: float


@dataclass(frozen=True, slots=True)
class ProcessVerdict:
    """One process: growth of its own memory, MB/h with its interval, and of what it holds.

    Own memory is ``RssAnon`` and ``RssShmem``: pages that no file stands behind.
    """

    role: str
    pid: int
    samples: int
    first_own_mb: float
    last_own_mb: float
    max_rss_mb: float
    mb_per_h: float
    mb_per_h_low: float
    mb_per_h_high: float
    descriptors_grown: int
    threads_grown: int
    memory: str
    """passed, failed, or undecided where the interval holds the limit."""

    @property
    def passed(self) -> bool:
        """Tell whether nothing grows."""
        return self.memory == "passed" and max(self.descriptors_grown, self.threads_grown) <= 0


def judge(samples: list[Sample]) -> list[ProcessVerdict]:
    """Judge every process by what it was after warming up.

    Raises
    ------
    ValueError
        If there are too few samples.
    """
    last_s = max(s.t_s for s in samples)
    warm_s = min(WARM_UP_SHARE * last_s, LONGEST_WARM_UP_S)
    warm = [s for s in samples if s.t_s >= warm_s]
    verdicts = [_judge_one([s for s in warm if s.pid == pid]) for pid in {s.pid for s in warm}]
    return sorted(verdicts, key=lambda verdict: (verdict.role, verdict.pid))


def _judge_one(own: list[Sample]) -> ProcessVerdict:
    t_h = np.array([s.t_s for s in own]) / 3600.0
    own_mb = np.array([s.own_mb for s in own])
    slope = robust_slope(t_h, own_mb)
    quarter = max(len(own) // 4, 1)
    if slope.high < MAX_MB_PER_H:
        memory = "passed"
    else:
        memory = "failed" if slope.low > MAX_MB_PER_H else "undecided"
    return ProcessVerdict(
        role=own[0].role,
        pid=own[0].pid,
        samples=len(own),
        first_own_mb=round(float(np.median(own_mb[:quarter])), 2),
        last_own_mb=round(float(np.median(own_mb[-quarter:])), 2),
        max_rss_mb=round(max(s.rss_mb for s in own), 1),
        mb_per_h=round(slope.value, 2),
        mb_per_h_low=round(slope.low, 2),
        mb_per_h_high=round(slope.high, 2),
        descriptors_grown=_grown(np.array([s.descriptors for s in own])),
        threads_grown=_grown(np.array([s.threads for s in own])),
        memory=memory,
    )


def _grown(counts: FloatArray) -> int:
    """Growth from the first quarter to the last, by medians."""
    quarter = max(len(counts) // 4, 1)
    return round(float(np.median(counts[-quarter:]) - np.median(counts[:quarter])))


def latency_figures(samples: list[Sample]) -> dict[str, float | None]:
    """Capture to report: medians of p50 and p99 in the first and the last third, in ms."""
    told = [s for s in samples if s.latency_p50_ms is not None and s.latency_p99_ms is not None]
    third = len(told) // 3
    if third == 0:
        return {"first_p50": None, "first_p99": None, "last_p50": None, "last_p99": None}
    parts = {"first": told[:third], "last": told[-third:]}
    return {
        f"{name}_{which}": round(
            float(np.median([float(getattr(s, f"latency_{which}_ms")) for s in part])), 2
        )
        for name, part in parts.items()
        for which in ("p50", "p99")
    }


def robust_slope(t: FloatArray, y: FloatArray) -> Slope:
    """Sen's slope of block medians, with Sen's interval, of y (N,) at ascending times t (N,).

    Neighbouring samples of a process's memory are nearly the same number, so that as many samples
    do not count as much evidence: the series is cut into up to 24 blocks of equal time first.

    Raises
    ------
    ValueError
        If there are fewer than 4 samples, or different blocks.
    """
    block = np.minimum((t - t[0]) / (t[-1] - t[0]) * _BLOCKS, _BLOCKS - 1).astype(int)
    filled = np.unique(block)
    if len(filled) < 4:
        raise ValueError(f"{len(filled)} blocks of samples, 4 needed")
    times = np.array([np.median(t[block == b]) for b in filled])
    values = np.array([np.median(y[block == b]) for b in filled])
    i, j = np.triu_indices(len(filled), k=1)
    slopes = np.sort((values[j] - values[i]) / (times[j] - times[i]))
    n = len(filled)
    reach = _Z95 * np.sqrt(n * (n - 1) * (2 * n + 5) / 18.0)
    low = int(np.floor((len(slopes) - reach) / 2.0))
    high = int(np.ceil((len(slopes) + reach) / 2.0))
    return Slope(
        float(np.median(slopes)),
        float(slopes[max(low, 0)]),
        float(slopes[min(high, len(slopes) - 1)]),
    )
