"""Errors that last, as those of an autopilot's estimates do."""

import math

import numpy as np


def correlated(rng, count, deviation, time_s, period_s):
    """First-order Gauss-Markov process (count, 3), one sample every ``period_s``."""
    kept = math.exp(-period_s / time_s)
    noise = rng.normal(0.0, deviation, (count, 3))
    values = [noise[0]]
    for step in noise[1:]:
        values.append(kept * values[-1] + math.sqrt(1.0 - kept**2) * step)
    return np.array(values)
