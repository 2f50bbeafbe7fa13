"""Semi-global matching: costs of labels, made smooth along four directions (Hirschmüller 2008)."""

from __future__ import annotations

import numpy as np

from dfvs_core.arrays import Float32Array

_STEP_COST = 0.06
"""For a neighbour one label away."""
_JUMP_COST = 1.0
"""For one further away, on an even surface; less where brightness jumps too."""
_EDGE_GREY = 8.0


def smooth_costs(costs: Float32Array, grey: Float32Array) -> Float32Array:
    """Sum of the cheapest ways to each label from four sides.

    Parameters
    ----------
    costs : (D, h, w)
        Of label k at each pixel, 0 to about 1.
    grey : (h, w)
        The picture: jumps are cheaper across its edges.

    Returns
    -------
    Float32Array
        (D, h, w)
    """
    down = _both_ways(costs.transpose(1, 0, 2), grey).transpose(1, 0, 2)
    right = _both_ways(costs.transpose(2, 0, 1), grey.T).transpose(1, 2, 0)
    return down + right


def _both_ways(costs: Float32Array, grey: Float32Array) -> Float32Array:
    """Cheapest ways (n, D, m) along the first axis, there and back."""
    edges = np.abs(np.diff(grey, axis=0)) / _EDGE_GREY
    jumps = np.asarray(_STEP_COST + _JUMP_COST / (1.0 + edges), np.float32)
    there = _one_way(np.ascontiguousarray(costs), jumps)
    back = _one_way(np.ascontiguousarray(costs[::-1]), jumps[::-1])
    there += back[::-1]
    return there


def _one_way(costs: Float32Array, jumps: Float32Array) -> Float32Array:
    """Cheapest ways (n, D, m) from the first row on; ``jumps`` (n - 1, m) between rows."""
    ways = np.empty_like(costs)
    ways[0] = costs[0]
    step = np.float32(_STEP_COST)
    for k in range(1, len(costs)):
        before = ways[k - 1]
        least = before.min(axis=0)
        best = np.minimum(before, least + jumps[k - 1])
        np.minimum(best[1:], before[:-1] + step, out=best[1:])
        np.minimum(best[:-1], before[1:] + step, out=best[:-1])
        ways[k] = costs[k] + (best - least)
    return ways
