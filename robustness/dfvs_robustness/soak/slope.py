"""How fast something grows, robustly, and how well that is known."""

from dataclasses import dataclass

import numpy as np

from dfvs_core.geometry.arrays import FloatArray

_BLOCKS = 24
_Z95 = 1.96


@dataclass(frozen=True, slots=True)
class Slope:
    """Growth per unit of time, and its 95 % confidence interval."""

    value: float
    low: float
    high: float


def robust_slope(t: FloatArray, y: FloatArray) -> Slope:
    """Sen's slope of block medians, with Sen's interval.

    Neighbouring samples of a process's memory are nearly the same number, so that as many samples
    do not count as much evidence: the series is cut into up to 24 blocks of equal time first.

    Parameters
    ----------
    t : (N,)
        Times, ascending; N >= 4 with at least 4 different blocks.
    y : (N,)
        Values.

    Raises
    ------
    ValueError
        If there are too few samples.
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
