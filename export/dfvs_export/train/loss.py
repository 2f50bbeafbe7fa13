"""What the training minimises."""

from __future__ import annotations

from dataclasses import dataclass

import torch
from torch import Tensor
from torch.nn import functional

from dfvs_export.networks.dfvs_flow import Look, Match
from dfvs_export.networks.sampling import chained

_DECAY = 0.8
_HIDDEN_WEIGHT = 0.05
_GOOD_PX = 2.0
_NEWTON_STEPS = 3
_NEWTON_REACH_PX = 8.0


@dataclass(frozen=True, slots=True)
class Truth:
    """Ground truth of N directed pairs.

    Parameters
    ----------
    flow : (N, 2, H, W)
        px.
    visible, solid : (N, 1, H, W)
        1.0 where the point is seen in both; where the flow means something.
    """

    flow: Tensor
    visible: Tensor
    solid: Tensor

    def at(self, stride: int) -> Truth:
        """Truth at the centres of cells of ``stride`` px (mean of the four pixels about it)."""
        skip = stride // 2 - 1
        parts = []
        for x in (self.flow, self.visible, self.solid):
            inner = functional.avg_pool2d(x[:, :, skip:, skip:], 2, stride)
            parts.append(inner)
        return Truth(parts[0], (parts[1] > 0.99).float(), (parts[2] > 0.99).float())


def flow_loss(match: Match, truth: Truth) -> tuple[Tensor, dict[str, float]]:
    """Weighted sum of all parts (a scalar), and the parts by name.

    The cells' softmax is trained as a classification, which converges far sooner than flow alone;
    later stages weigh more; hidden points count a little.
    """
    at8, at4 = truth.at(8), truth.at(4)
    matching = matching_loss(match.similarity, at8)
    total = 0.5 * matching
    looking = torch.stack([look_loss(look, at4) for look in match.looks]).mean()
    total = total + looking
    parts = {"matching": float(matching.detach()), "looking": float(looking.detach())}
    updates = match.stages[2:]
    for k, flow in enumerate(updates):
        there = at8 if flow.shape[2] == at8.flow.shape[2] else at4
        total = total + 0.5 * _DECAY ** (len(updates) - 1 - k) * robust_error(flow, there)
    full = robust_error(match.flow, truth)
    judged = _judgement_loss(match, at4)
    parts |= {"flow": float(full.detach()), "judged": float(judged.detach())}
    return total + full + 0.5 * judged, parts


def robust_error(flow: Tensor, truth: Truth) -> Tensor:
    """Mean of (e^2 + 0.05^2)^0.4 over the pixels; hidden ones weigh 0.05."""
    square = ((flow - truth.flow) ** 2).sum(1, keepdim=True)
    weight = truth.visible + _HIDDEN_WEIGHT * (truth.solid - truth.visible).clamp(min=0.0)
    return (weight * (square + 0.0025) ** 0.4).sum() / weight.sum().clamp(min=1.0)


def matching_loss(similarity: Tensor, truth: Truth) -> Tensor:
    """Cross-entropy of rows and columns of the similarity against the true (bilinear) cell."""
    h, w = truth.flow.shape[2:]
    y, x = torch.meshgrid(
        torch.arange(h, device=truth.flow.device, dtype=torch.float32),
        torch.arange(w, device=truth.flow.device, dtype=torch.float32),
        indexing="ij",
    )
    tx = (x + truth.flow[:, 0] / 8.0).flatten(1)
    ty = (y + truth.flow[:, 1] / 8.0).flatten(1)
    inside = (tx > -0.5) & (tx < w - 0.5) & (ty > -0.5) & (ty < h - 0.5)
    valid = (truth.visible.flatten(1) > 0) & inside
    x0, y0 = tx.floor(), ty.floor()
    cells, weights = [], []
    for dx in (0, 1):
        for dy in (0, 1):
            weights.append((1.0 - (tx - x0 - dx).abs()) * (1.0 - (ty - y0 - dy).abs()))
            cells.append((y0 + dy).clamp(0, h - 1) * w + (x0 + dx).clamp(0, w - 1))
    cell = torch.stack(cells, 2).long()  # (N, h w, 4)
    rows = torch.logsumexp(similarity, dim=2, keepdim=True)
    columns = torch.logsumexp(similarity, dim=1)
    column = columns.gather(1, cell.flatten(1)).reshape(cell.shape)
    log_shared = 2.0 * similarity.gather(2, cell) - rows - column
    loss = -(torch.stack(weights, 2) * log_shared).sum(2)
    return (loss * valid).sum() / valid.sum().clamp(min=1)


def look_loss(look: Look, truth: Truth) -> Tensor:
    """Cross-entropy of a look-up against the true (bilinear) place, where it lies within."""
    looked = look.seen.shape[1]
    radius = (round(looked**0.5) - 1) // 2
    place = truth.flow if look.base is None else before_warp(truth.flow, look.base)
    dx, dy = ((place - look.flow) / look.stride).unsqueeze(2).unbind(1)  # (N, 1, h, w)
    step = torch.arange(-radius, radius + 1, device=dx.device, dtype=dx.dtype)
    across = step.repeat(len(step)).reshape(1, looked, 1, 1)
    down = step.repeat_interleave(len(step)).reshape(1, looked, 1, 1)
    weight = (1.0 - (dx - across).abs()).clamp(min=0) * (1.0 - (dy - down).abs()).clamp(min=0)
    inside = (dx.abs() < radius) & (dy.abs() < radius) & (truth.visible > 0)
    loss = -(weight * torch.log_softmax(look.seen, dim=1)).sum(1, keepdim=True)
    mean: Tensor = (loss * inside).sum() / inside.sum().clamp(min=1)
    return mean


@torch.no_grad()
def before_warp(flow: Tensor, base: Tensor) -> Tensor:
    """Displacement d (N, 2, h, w) px with d + base(x + d) = flow, by Newton's method.

    That is where, in an image warped by ``base``, the point is that ``flow`` leads to.
    """
    d = torch.zeros_like(flow)
    for _ in range(_NEWTON_STEPS):
        here = chained(d, base)
        right = chained(d + _unit_step(d, 0), base) - here  # columns of the Jacobian, per px
        down = chained(d + _unit_step(d, 1), base) - here
        miss = flow - here
        determinant = right[:, 0] * down[:, 1] - right[:, 1] * down[:, 0]
        determinant = torch.where(determinant.abs() < 0.2, 0.2, determinant)
        x = (miss[:, 0] * down[:, 1] - miss[:, 1] * down[:, 0]) / determinant
        y = (right[:, 0] * miss[:, 1] - right[:, 1] * miss[:, 0]) / determinant
        d = d + torch.stack([x, y], 1).clamp(-_NEWTON_REACH_PX, _NEWTON_REACH_PX)
    return torch.where((chained(d, base) - flow).norm(dim=1, keepdim=True) < 0.5, d, torch.inf)


def _unit_step(like: Tensor, axis: int) -> Tensor:
    """One px along an axis, broadcastable to (N, 2, h, w)."""
    step = torch.zeros(1, 2, 1, 1, dtype=like.dtype, device=like.device)
    step[0, axis] = 1.0
    return step


def _judgement_loss(match: Match, truth: Truth) -> Tensor:
    """Cross-entropy of both judgements: seen in both, and flow good to some 2 px.

    The first judgement is of the last stage before the warp, the second of the very last.
    """
    stages = [s for s in match.stages if s.shape[2] == truth.flow.shape[2]]
    warped = sum(look.base is not None for look in match.looks)
    total = torch.zeros((), device=truth.flow.device)
    for judged, flow in zip(match.judged, (stages[-1 - warped], stages[-1]), strict=True):
        seen = functional.binary_cross_entropy_with_logits(judged[:, :1], truth.visible)
        error = (flow.detach() - truth.flow).norm(dim=1, keepdim=True)
        good = torch.exp(-((error / _GOOD_PX) ** 2))
        sure = functional.binary_cross_entropy_with_logits(judged[:, 1:], good, reduction="none")
        total = total + seen + (sure * truth.visible).sum() / truth.visible.sum().clamp(min=1.0)
    return total
