"""Places in images and what is found there: look-ups, warps, correlation, upsampling.

Flow is in px of the full image at every resolution, as (x, y); cell (i, j) of a map of stride s
has its centre at ((j + 0.5) s, (i + 0.5) s).
"""

from __future__ import annotations

from typing import Any

import torch
from torch import Tensor
from torch.nn import functional


def double(x: Tensor) -> Tensor:
    """Bilinear upsampling by 2."""
    return functional.interpolate(x, scale_factor=2.0, mode="bilinear", align_corners=False)


def cell_centres(like: Tensor, stride: int) -> Tensor:
    """Centres (1, 2, h, w) in px of the cells of a map (N, C, h, w)."""
    h, w = like.shape[2:]
    y = (torch.arange(h, device=like.device, dtype=torch.float32) + 0.5) * stride
    x = (torch.arange(w, device=like.device, dtype=torch.float32) + 0.5) * stride
    return torch.stack([x.expand(h, w), y.unsqueeze(1).expand(h, w)]).unsqueeze(0)


def sample(maps: Tensor, x: Tensor, y: Tensor, stride: int) -> Tensor:
    """Bilinear values (M, C, ...) of maps (M, C, h, w) at positions x, y (M, a, b) px."""
    h, w = maps.shape[2:]
    grid = torch.stack([x * (2.0 / (stride * w)) - 1.0, y * (2.0 / (stride * h)) - 1.0], dim=-1)
    return functional.grid_sample(
        maps, grid, mode="bilinear", padding_mode="zeros", align_corners=False
    )


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
    dx = steps.expand(side, side).unsqueeze(0)
    dy = steps.unsqueeze(1).expand(side, side).unsqueeze(0)
    centre = target.permute(0, 2, 3, 1).reshape(n * h * w, 2, 1, 1)
    maps = volume.reshape(n * h * w, 1, h, w)
    values = sample(maps, centre[:, 0] + dx, centre[:, 1] + dy, 8)
    return values.reshape(n, h, w, side * side).permute(0, 3, 1, 2)


def chained(first: Tensor, second: Tensor) -> Tensor:
    """Flow (N, 2, h4, w4) px of going ``first`` and from there ``second``, both at 1/4."""
    h, w = second.shape[2:]
    target = cell_centres(second, 4) + first
    x = target[:, 0].clamp(2.0, 4.0 * w - 2.0)
    y = target[:, 1].clamp(2.0, 4.0 * h - 2.0)
    return first + sample(second, x, y, 4)


def convex_upsample(flow: Tensor, mask: Tensor) -> Tensor:
    """Flow (N, 2, h, w) to (N, 2, 4 h, 4 w): convex sums of 3 x 3 neighbours, as in RAFT.

    ``mask`` is (N, 9 * 16, h, w) logits.
    """
    n, _, h, w = flow.shape
    logits = mask.reshape(n, 9, 16, h, w)
    weights = torch.exp(logits - logits.amax(1, keepdim=True)).unbind(1)  # 9 of (N, 16, h, w)
    padded = functional.pad(flow, (1, 1, 1, 1), mode="replicate")
    x, y, total = (torch.zeros_like(weights[0]) for _ in range(3))
    for k, weight in enumerate(weights):
        i, j = divmod(k, 3)
        near = padded[:, :, i : i + h, j : j + w].unsqueeze(2)  # (N, 2, 1, h, w)
        total = total + weight
        x = x + weight * near[:, 0]
        y = y + weight * near[:, 1]
    return functional.pixel_shuffle(torch.cat([x / total, y / total], 1), 4)


def local_correlation(first: Tensor, second: Tensor, radius: int) -> Tensor:
    """Mean products (N, (2 radius + 1)^2, h, w) of features (N, C, h, w) with shifted ones."""
    if torch.is_grad_enabled():
        correlated: Tensor = _LocalCorrelation.apply(first, second, radius)  # type: ignore[no-untyped-call]
        return correlated
    n, c, h, w = first.shape
    mean = torch.full((n, 1, c), 1.0 / c, dtype=first.dtype, device=first.device)
    # a product with a row of ones: runs much faster than a mean over the channels does
    values = [mean @ (first * part).flatten(2) for part in _shifted(second, radius)]
    return torch.cat(values, 1).reshape(n, -1, h, w)


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
