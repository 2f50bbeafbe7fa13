"""LighterGlue: LightGlue (Lindenberger et al., ICCV 2023) of width 96 with one head, on XFeat."""

from __future__ import annotations

from typing import NamedTuple

import torch
from torch import Tensor, nn
from torch.nn import functional

from dfvs_export.networks.xfeat import Keypoints

_MASKED = -1e4


class Assignment(NamedTuple):
    """Log probability of each pair (B, N, M), and logits (B, N), (B, M) that a point has one."""

    log_probability: Tensor
    first_matchable: Tensor
    second_matchable: Tensor


class LighterGlue(nn.Module):
    """Matches keypoints by self- and cross-attention.

    Parameters
    ----------
    size : tuple of int
        (width, height) px of the images that the points lie in.
    """

    def __init__(
        self, size: tuple[int, int], width: int = 96, inputs: int = 64, layers: int = 6
    ) -> None:
        super().__init__()
        self.size = size
        self.input_proj = nn.Linear(inputs, width)
        self.posenc = _Position(width)
        self.transformers = nn.ModuleList(_Layer(width) for _ in range(layers))
        self.log_assignment = nn.ModuleList(_Assign(width) for _ in range(layers))

    def forward(self, first: Keypoints, second: Keypoints) -> Assignment:
        """Assignment after the last layer."""
        return self.assign(first, second, *self.attend(first, second))

    def attend(self, first: Keypoints, second: Keypoints) -> tuple[Tensor, Tensor]:
        """Features (B, N, C) and (B, M, C) after the last layer of attention."""
        x, y = self.input_proj(first.descriptors), self.input_proj(second.descriptors)
        of_x, of_y = (self.posenc(self._normalised(k.points)) for k in (first, second))
        masked = (_masked(first), _masked(second))
        for layer in self.transformers:
            x, y = layer(x, y, (of_x, of_y), masked)
        return x, y

    def assign(self, first: Keypoints, second: Keypoints, x: Tensor, y: Tensor) -> Assignment:
        """Assignment by the features of :meth:`attend`."""
        result: Assignment = self.log_assignment[-1](x, y, _masked(first), _masked(second))
        return result

    def _normalised(self, points: Tensor) -> Tensor:
        """Points in half of the longer side, from the middle."""
        middle = torch.tensor(self.size, dtype=points.dtype, device=points.device) / 2
        return (points - middle) / (max(self.size) / 2)


def _masked(keypoints: Keypoints) -> Tensor:
    """Logits (B, 1, N) by which no point of score 0 is attended to."""
    return ((keypoints.scores <= 0).to(keypoints.scores.dtype) * _MASKED)[:, None]


class _Position(nn.Module):
    """Rotary encoding of positions by learned frequencies."""

    def __init__(self, width: int) -> None:
        super().__init__()
        self.Wr = nn.Linear(2, width // 2, bias=False)

    def forward(self, points: Tensor) -> tuple[Tensor, Tensor]:
        angle = self.Wr(points)
        angle = torch.stack((angle, angle), dim=-1).reshape(*angle.shape[:2], -1)
        return torch.cos(angle), torch.sin(angle)


def _rotated(x: Tensor, position: tuple[Tensor, Tensor]) -> Tensor:
    """Pairs of channels of x (B, N, C) turned by the position's angles."""
    cosine, sine = position
    turned = torch.stack((-x[..., 1::2], x[..., ::2]), dim=-1).reshape(x.shape)
    return x * cosine + turned * sine


def _feed_forward(width: int) -> nn.Sequential:
    return nn.Sequential(
        nn.Linear(2 * width, 2 * width),
        nn.LayerNorm(2 * width),
        nn.GELU(),
        nn.Linear(2 * width, width),
    )


class _SelfAttention(nn.Module):
    def __init__(self, width: int) -> None:
        super().__init__()
        self.Wqkv = nn.Linear(width, 3 * width)
        self.out_proj = nn.Linear(width, width)
        self.ffn = _feed_forward(width)

    def forward(self, x: Tensor, position: tuple[Tensor, Tensor], masked: Tensor) -> Tensor:
        both = self.Wqkv(x)
        q, k, v = (both[..., part::3] for part in range(3))
        q, k = _rotated(q, position), _rotated(k, position)
        similar = q @ k.transpose(-1, -2) * q.shape[-1] ** -0.5
        message = self.out_proj(torch.softmax(similar + masked, dim=-1) @ v)
        result: Tensor = x + self.ffn(torch.cat([x, message], dim=-1))
        return result


class _CrossAttention(nn.Module):
    def __init__(self, width: int) -> None:
        super().__init__()
        self.to_qk = nn.Linear(width, width)
        self.to_v = nn.Linear(width, width)
        self.to_out = nn.Linear(width, width)
        self.ffn = _feed_forward(width)

    def forward(self, x: Tensor, y: Tensor, no_x: Tensor, no_y: Tensor) -> tuple[Tensor, Tensor]:
        similar = self.to_qk(x) @ self.to_qk(y).transpose(-1, -2) * x.shape[-1] ** -0.5
        to_x = torch.softmax(similar + no_y, dim=-1) @ self.to_v(y)
        to_y = torch.softmax(similar.transpose(-1, -2) + no_x, dim=-1) @ self.to_v(x)
        return (
            x + self.ffn(torch.cat([x, self.to_out(to_x)], dim=-1)),
            y + self.ffn(torch.cat([y, self.to_out(to_y)], dim=-1)),
        )


class _Layer(nn.Module):
    def __init__(self, width: int) -> None:
        super().__init__()
        self.self_attn = _SelfAttention(width)
        self.cross_attn = _CrossAttention(width)

    def forward(
        self,
        x: Tensor,
        y: Tensor,
        positions: tuple[tuple[Tensor, Tensor], tuple[Tensor, Tensor]],
        masked: tuple[Tensor, Tensor],
    ) -> tuple[Tensor, Tensor]:
        x = self.self_attn(x, positions[0], masked[0])
        y = self.self_attn(y, positions[1], masked[1])
        both: tuple[Tensor, Tensor] = self.cross_attn(x, y, *masked)
        return both


class _Assign(nn.Module):
    def __init__(self, width: int) -> None:
        super().__init__()
        self.matchability = nn.Linear(width, 1)
        self.final_proj = nn.Linear(width, width)

    def forward(self, x: Tensor, y: Tensor, no_x: Tensor, no_y: Tensor) -> Assignment:
        similar = self.final_proj(x) @ self.final_proj(y).transpose(-1, -2) * x.shape[-1] ** -0.5
        zx, zy = self.matchability(x), self.matchability(y)
        log = functional.log_softmax(similar + no_y, dim=-1)
        log = log + functional.log_softmax(similar + no_x.transpose(-1, -2), dim=-2)
        log = log + functional.logsigmoid(zx) + functional.logsigmoid(zy).transpose(-1, -2)
        return Assignment(log, zx.squeeze(-1), zy.squeeze(-1))
