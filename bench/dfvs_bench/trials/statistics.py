"""Statistics of results, some of which may be unknown (None)."""

import math
from collections.abc import Sequence

import numpy as np


def rounded(value: float | None, digits: int) -> float | None:
    """Rounded value; None where it is unknown or not finite."""
    return None if value is None or not math.isfinite(value) else round(value, digits)


def mean(values: Sequence[float | None]) -> float | None:
    """Mean of the known values."""
    known = [value for value in values if value is not None]
    return float(np.mean(known)) if known else None


def largest(values: Sequence[float | None]) -> float | None:
    """Largest of the known values."""
    return max((value for value in values if value is not None), default=None)


def settled_index(inside: Sequence[bool]) -> int | None:
    """Index from which on all are true; None where the last one is not."""
    outside = [k for k, is_inside in enumerate(inside) if not is_inside]
    first = outside[-1] + 1 if outside else 0
    return first if first < len(inside) else None
