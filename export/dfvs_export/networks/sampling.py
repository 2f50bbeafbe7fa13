"""Places in images and what is found there: look-ups, warps, correlation, upsampling.

Flow is in px of the full image at every resolution, as (x, y); cell (i, j) of a map of stride s
has its centre at ((j + 0.5) s, (i + 0.5) s).
"""

from __future__ import annotations

from typing import Any

import torch
from torch import Tensor
from torch.nn import functional

_MAX_LOGIT = 60.0
"""No exponential of it is infinite, and none vanishes: a maximum need not be looked for."""


def double(x: Tensor) -> Tensor:
    """Bilinear upsampling by 2."""
    return functional.interpolate(x, scale_factor=2.0, mode="bilinear", align_corners=False)


def cell_centres(like: Tensor, stride: int) -> Tensor:
    """Centres (1, 2, h, w) in px of the cells of a map (N, C, h, w)."""
    h, w = like.shape[2:]
    y = (torch.arange(h, device=like.device, dtype=torch.float32) + 0.5) * stride
    x = (torch.arange(w, device=like.device, dtype=torch.float32) + 0.5) * stride
    return torch.stack([x.expand(h, w), y.unsqueeze(1).expand(h, w)]).unsqueeze(0)


def sample(maps: Tensor, target: Tensor, stride: int) -> Tensor:
    """Bilinear values of maps at targets; zero outside.

    Parameters
    ----------
    maps : (M, C, h, w)
        Of this stride.
    target : (M, 2, a, b)
        px.

    Returns
    -------
    Tensor
        (M, C, a, b)
    """
    grid = _relative(target, maps, stride).permute(0, 2, 3, 1)
    return _sample_relative(maps, grid)


def _relative(target: Tensor, maps: Tensor, stride: int) -> Tensor:
    """Targets (..., 2, a, b) px as shares of the maps, -1 to 1.

    Done before x and y come last: runtimes are slow where the innermost dimension is two long.
    """
    h, w = maps.shape[-2:]
    per_px = torch.tensor([2.0 / (stride * w), 2.0 / (stride * h)], device=maps.device)
    return target * per_px.reshape(2, 1, 1) - 1.0


def _sample_relative(maps: Tensor, grid: Tensor) -> Tensor:
    return functional.grid_sample(
        maps, grid, mode="bilinear", padding_mode="zeros", align_corners=False
    )


def warp(maps: Tensor, flow: Tensor, stride: int) -> Tensor:
    """Maps (N, C, h, w) seen from where the flow (N, 2, h, w) px starts."""
    return sample(maps, cell_centres(flow, stride) + flow, stride)


def look_up(volume: Tensor, target: Tensor, radius: int) -> Tensor:
    """Values around the targets.

    Parameters
    ----------
    volume : (N, h w, h w)
        One map of the second image per cell of the first (at 1/8).
    target : (N, 2, h, w)
        Where to look, px.

    Returns
    -------
    Tensor
        (N, (2 radius + 1)^2, h, w)
    """
    n, _, h, w = target.shape
    side = 2 * radius + 1
    steps = torch.arange(-radius, radius + 1, device=target.device, dtype=torch.float32) * 8.0
    around = torch.stack([steps.repeat(side), steps.repeat_interleave(side)]).unsqueeze(1)
    maps = volume.reshape(n * h * w, 1, h, w)
    places = target.reshape(n, 2, h * w, 1) + around  # (N, 2, h w, side^2)
    grid = _relative(places, maps, 8).permute(0, 2, 3, 1)
    values = _sample_relative(maps, grid.reshape(n * h * w, side, side, 2))
    return values.reshape(n, h * w, side * side).transpose(1, 2).reshape(n, side * side, h, w)


def chained(first: Tensor, second: Tensor) -> Tensor:
    """Flow (N, 2, h4, w4) px of going ``first`` and from there ``second``, both at 1/4."""
    h, w = second.shape[2:]
    last = torch.tensor([4.0 * w - 2.0, 4.0 * h - 2.0], device=first.device).reshape(1, 2, 1, 1)
    inside = torch.minimum((cell_centres(second, 4) + first).clamp(min=2.0), last)
    return first + sample(second, inside, 4)


def convex_upsample(flow: Tensor, mask: Tensor) -> Tensor:
    """Flow (N, 2, h, w) to (N, 2, 4 h, 4 w): convex sums of 3 x 3 neighbours, as in RAFT.

    ``mask`` is (N, 9 * 16, h, w) logits.
    """
    n, _, h, w = flow.shape
    logits = mask.reshape(n, 9, 16 * h * w).clamp(-_MAX_LOGIT, _MAX_LOGIT)
    weights = torch.exp(logits).reshape(n, 1, 9, 16, h * w)
    padded = functional.pad(flow, (1, 1, 1, 1), mode="replicate")
    near = torch.stack([padded[:, :, i : i + h, j : j + w] for i in range(3) for j in range(3)], 2)
    weighted = weights * near.reshape(n, 2, 9, 1, h * w)
    ones = torch.ones(1, 9, dtype=flow.dtype, device=flow.device)  # a product sums more quickly
    sums = ones @ weighted.reshape(n, 2, 9, 16 * h * w)
    total = ones @ weights.reshape(n, 1, 9, 16 * h * w)
    return functional.pixel_shuffle((sums / total).reshape(n, 32, h, w), 4)


def local_correlation(first: Tensor, second: Tensor, radius: int) -> Tensor:
    """Mean products (N, (2 radius + 1)^2, h, w) of features (N, C, h, w) with shifted ones."""
    if torch.is_grad_enabled():
        correlated: Tensor = _LocalCorrelation.apply(first, second, radius)  # type: ignore[no-untyped-call]
        return correlated
    n, c, h, w = first.shape
    side, block = 2 * radius + 1, _block(w)
    wide, blocks = block + 2 * radius, w // block
    padded = functional.pad(second, (radius, radius, radius, radius)).permute(0, 2, 3, 1)
    cells = padded.reshape(n, -1, c)  # of all rows, one after the other
    others = cells[:, _neighbourhoods((h, w), block, radius)].reshape(n, h, blocks, side * wide, c)
    own = (first * (1.0 / c)).reshape(n, c, h, blocks, block).permute(0, 2, 3, 1, 4)
    # All pairs of a few neighbouring cells with all that is around them: four times the products
    # that are asked for, but at full speed. Cell x sees neighbour (i, j) in row i wide + x + j.
    pairs = (others @ own).reshape(n, h, blocks, side * wide * block)
    starts = ((i * wide + j) * block for i in range(side) for j in range(side))
    length = (block - 1) * (block + 1) + 1
    near = [pairs[..., start : start + length : block + 1] for start in starts]  # (N, h, blocks, _)
    return torch.cat(near, 1).reshape(n, side * side, h, w)


def _block(cells: int) -> int:
    """Length of the blocks that a row of ``cells``, a multiple of 4, is cut into."""
    return max(size for size in (4, 8, 12, 16) if cells % size == 0)


def _neighbourhoods(size: tuple[int, int], block: int, radius: int) -> Tensor:
    """Cells of a padded map that are around each block of a map of ``size`` (h, w), in order."""
    h, w = size
    rows = torch.arange(h)[:, None] + torch.arange(2 * radius + 1)  # (h, side)
    columns = torch.arange(0, w, block)[:, None] + torch.arange(block + 2 * radius)
    index = rows[:, None, :, None] * (w + 2 * radius) + columns[None, :, None, :]
    return index.flatten()  # of (h, blocks, side, wide)


def _shifted(features: Tensor, radius: int) -> list[Tensor]:
    """Views of the features moved by up to ``radius`` cells, row by row; zeros come in."""
    h, w = features.shape[2:]
    padded = functional.pad(features, (radius, radius, radius, radius))
    side = range(2 * radius + 1)
    return [padded[:, :, i : i + h, j : j + w] for i in side for j in side]


class _LocalCorrelation(torch.autograd.Function):
    """The same with a gradient that adds in place: five times faster than autograd's own."""

    @staticmethod
    def forward(ctx: Any, first: Tensor, second: Tensor, radius: int) -> Tensor:
        ctx.save_for_backward(first, second)
        ctx.radius = radius
        return torch.stack([(first * part).mean(1) for part in _shifted(second, radius)], 1)

    @staticmethod
    def backward(ctx: Any, grad: Tensor) -> tuple[Tensor, Tensor, None]:
        first, second = ctx.saved_tensors
        r = ctx.radius
        to_first = torch.zeros_like(first)
        to_padded = functional.pad(torch.zeros_like(second), (r, r, r, r))
        h, w = second.shape[2:]
        scaled = grad / first.shape[1]
        for k, part in enumerate(_shifted(second, r)):
            i, j = divmod(k, 2 * r + 1)
            slope = scaled[:, k : k + 1]
            to_first.addcmul_(slope, part)
            to_padded[:, :, i : i + h, j : j + w].addcmul_(slope, first)
        return to_first, to_padded[:, :, r : r + h, r : r + w], None
