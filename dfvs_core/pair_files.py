"""Layout of files of picture pairs with exact flow, where makers and readers agree on it.

Pixel centres lie at +0.5; pictures are RGB. An *evaluation file* is one ``.npz`` with

- ``IA``, ``IB`` (N, H, W, 3) uint8, the two pictures;
- ``flow`` (N, H, W, 2) float16 px, from A to B on A's grid;
- ``vis`` (N, H, W) bool, seen in both;
- ``level`` (N,) int64, index into ``dfvs_core.matching.evaluation.LEVELS``;
- and, not needed to measure, ``depth`` (N, H, W) float16 m of A (0: nothing) and ``TA``, ``TB``
  (N, 4, 4) float64, world from camera in the scene file's axes (y up).

A *shard* of training pairs is one ``.npz`` without compression with

- ``images`` (N, 2, 3, H, W) uint8;
- ``flows`` (N, 2, 2, H, W) float16 px, A to B and B to A, cut to ``MAX_FLOW_SIDES`` picture sides;
- ``visible`` (N, 2, H, W) bool, seen in both;
- ``solid`` (N, 2, H, W) bool, the flow means something.
"""

from __future__ import annotations

EVALUATION_ARRAYS = ("IA", "IB", "flow", "vis", "level")
"""Arrays that a measurement needs."""
SHARD_ARRAYS = ("images", "flows", "visible", "solid")
"""Arrays of a shard."""
PAIRS_PER_SHARD = 64
MAX_FLOW_SIDES = 4
"""Flows in shards are cut to this many times the longer side of the picture."""

SMALL_SHARE, MEDIUM_SHARE = 0.15, 0.25
"""Shares of training pairs of small and of medium motion; the others move a lot."""
LARGEST_REACH = 0.8
"""The farthest that those go, as a share of the median depth or of ``FARTHEST_DEPTH_M``."""
FARTHEST_DEPTH_M = 3.0
"""What lies farther away counts as this far, m."""


def shard_name(size: tuple[int, int], seed: int) -> str:
    """File name of a shard of pictures of size (width, height) px; shards sort by their seed."""
    return f"shard-{size[0]}x{size[1]}-{seed:08d}.npz"


def shard_pattern(size: tuple[int, int]) -> str:
    """Glob pattern of all shards of pictures of size (width, height) px."""
    return f"shard-{size[0]}x{size[1]}-*.npz"
