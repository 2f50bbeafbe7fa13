"""LighterGlue: LightGlue (Lindenberger et al., ICCV 2023) of width 96 with one head, on XFeat.

Linear maps that follow one another are one map here: points are attended to as they are, and the
published projections of values and messages are part of the feed-forward layer after them
(``dfvs_export.weights.flow``).
"""

from typing import NamedTuple, cast

import torch
from torch import Tensor, nn
from torch.nn import functional

from dfvs_export.networks.xfeat import Keypoints

LAYERS = 6
_WIDTH, _INPUTS = 96, 64
"""Channels of its features, and of the descriptors that go in."""
_LEAST_WEIGHT_LOG = -80.0
"""Logarithm of the least weight in attention over the largest. Smaller ones would change no sum in
float32, and could be subnormal numbers, with which processors are slow."""


class Assignment(NamedTuple):
    """Log probability of each pair (B, N, M), and logits (B, N), (B, M) that a point has one."""

    log_probability: Tensor
    first_matchable: Tensor
    second_matchable: Tensor


class LighterGlue(nn.Module):
    """Matches keypoints of images of one size (width, height) px by self- and cross-attention.

    Those of the second image go through it behind those of the first, (B, N + M, C).
    """

    def __init__(self, size: tuple[int, int]) -> None:
        super().__init__()
        self.size = size
        self.input_proj = nn.Linear(_INPUTS, _WIDTH)
        self.frequencies = nn.Linear(2, _WIDTH // 2, bias=False)
        self.layers = nn.ModuleList(_Layer() for _ in range(LAYERS))
        self.final_proj = nn.Linear(_WIDTH, _WIDTH)
        self.matchability = nn.Linear(_WIDTH, 1)

    def forward(self, first: Keypoints, second: Keypoints) -> Assignment:
        """Assignment after the last layer."""
        return self.assign(self.attend(first, second), first.points.shape[1])

    def attend(self, first: Keypoints, second: Keypoints) -> Tensor:
        """Features (B, N + M, C) after the last layer of attention."""
        x = self.input_proj(torch.cat([first.descriptors, second.descriptors], dim=1))
        angle = self.frequencies(self._normalised(torch.cat([first.points, second.points], dim=1)))
        position = angle.cos().repeat(1, 1, 2), angle.sin().repeat(1, 1, 2)
        count = first.points.shape[1]
        for layer in self.layers:
            x = layer(x, position, count)
        return cast(Tensor, x)

    def assign(self, x: Tensor, count: int) -> Assignment:
        """Assignment by the features of :meth:`attend`, of which ``count`` are the first's."""
        similar = _similarity(*_sides(self.final_proj(x), count))
        of_first, of_second = _sides(self.matchability(x), count)
        log = functional.log_softmax(similar, dim=-1) + functional.log_softmax(similar, dim=-2)
        log = log + functional.logsigmoid(of_first)
        log = log + functional.logsigmoid(of_second).transpose(-1, -2)
        return Assignment(log, of_first.squeeze(-1), of_second.squeeze(-1))

    def _normalised(self, points: Tensor) -> Tensor:
        """Points in half of the longer side, from the middle."""
        middle = torch.tensor(self.size, dtype=points.dtype, device=points.device) / 2
        return (points - middle) / (max(self.size) / 2)


def _sides(x: Tensor, count: int) -> tuple[Tensor, Tensor]:
    """What is the first image's (B, N, C), of ``count`` points, and what the second's."""
    return x[:, :count], x[:, count:]


def _similarity(queries: Tensor, keys: Tensor) -> Tensor:
    """Scaled product (B, N, M) of each of (B, N, C) with each of (B, M, C)."""
    result: Tensor = queries @ keys.transpose(-1, -2) * queries.shape[-1] ** -0.5
    return result


def attended(logits: Tensor, points: Tensor) -> Tensor:
    """Mean (B, N, C) of points (B, M, C) by the softmax of logits (B, N, M)."""
    least = logits.detach().amax(dim=-1, keepdim=True) + _LEAST_WEIGHT_LOG
    result: Tensor = torch.softmax(torch.maximum(logits, least), dim=-1) @ points
    return result


class _Attention(nn.Module):
    """Feed-forward layer on a point and the mean of what it attends to, added to the point."""

    def __init__(self) -> None:
        super().__init__()
        self.ffn = nn.Sequential(
            nn.Linear(2 * _WIDTH, 2 * _WIDTH),
            nn.LayerNorm(2 * _WIDTH),
            nn.GELU(),
            nn.Linear(2 * _WIDTH, _WIDTH),
        )

    def updated(self, x: Tensor, *attended: Tensor) -> Tensor:
        """Features after it, from what each image's points attend to."""
        result: Tensor = x + self.ffn(torch.cat([x, torch.cat(attended, dim=1)], dim=-1))
        return result


class _SelfAttention(_Attention):
    """Attention to the points of the same image, by rotary encoding of their positions.

    Channels of ``to_qk`` come in pairs that are turned: first the one of each, then the other.
    """

    def __init__(self) -> None:
        super().__init__()
        self.to_qk = nn.Linear(_WIDTH, 2 * _WIDTH)

    def forward(self, x: Tensor, position: tuple[Tensor, Tensor], count: int) -> Tensor:
        one, other = self.to_qk(x).chunk(2, dim=-1)
        cosine, sine = position
        turned = one * cosine - other * sine, other * cosine + one * sine
        q, k = (
            torch.cat(parts, dim=-1)
            for parts in zip(*(t.chunk(2, dim=-1) for t in turned), strict=True)
        )
        sides = (_sides(every, count) for every in (q, k, x))
        return self.updated(
            x,
            *(
                attended(_similarity(queries, keys), points)
                for queries, keys, points in zip(*sides, strict=True)
            ),
        )


class _CrossAttention(_Attention):
    """Attention to the points of the other image."""

    def __init__(self) -> None:
        super().__init__()
        self.to_qk = nn.Linear(_WIDTH, _WIDTH)

    def forward(self, x: Tensor, count: int) -> Tensor:
        first, second = _sides(x, count)
        similar = _similarity(*_sides(self.to_qk(x), count))
        return self.updated(
            x, attended(similar, second), attended(similar.transpose(-1, -2), first)
        )


class _Layer(nn.Module):
    def __init__(self) -> None:
        super().__init__()
        self.self_attn = _SelfAttention()
        self.cross_attn = _CrossAttention()

    def forward(self, x: Tensor, position: tuple[Tensor, Tensor], count: int) -> Tensor:
        result: Tensor = self.cross_attn(self.self_attn(x, position, count), count)
        return result
