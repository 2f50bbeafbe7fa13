"""Attention within and across two images, which makes repeated things distinct."""

from __future__ import annotations

import torch
from torch import Tensor, nn
from torch.nn import functional

from dfvs_export.networks.architecture import FlowArchitecture
from dfvs_export.networks.encoder import Features
from dfvs_export.networks.sampling import double


class _Attention(nn.Module):
    """Pre-norm attention of tokens (N, T, C) to a source (N, S, C), then a feed-forward part."""

    def __init__(self, channels: int, heads: int) -> None:
        super().__init__()
        self.heads = heads
        self.norm_query = nn.LayerNorm(channels)
        self.norm_source = nn.LayerNorm(channels)
        self.query = nn.Linear(channels, channels)
        self.key = nn.Linear(channels, channels)
        self.value = nn.Linear(channels, channels)
        self.out = nn.Linear(channels, channels)
        self.norm_forward = nn.LayerNorm(channels)
        self.forward_in = nn.Linear(channels, 2 * channels)
        self.forward_out = nn.Linear(2 * channels, channels)
        for last in (self.out, self.forward_out):
            nn.init.normal_(last.weight, std=0.01)
            nn.init.constant_(last.bias, 0.0)

    def _split(self, x: Tensor) -> Tensor:
        n, t, c = x.shape
        return x.reshape(n, t, self.heads, c // self.heads).transpose(1, 2)

    def forward(self, x: Tensor, source: Tensor) -> Tensor:
        n, t, c = x.shape
        source = self.norm_source(source)
        q = self._split(self.query(self.norm_query(x))) * (c // self.heads) ** -0.5
        k, v = self._split(self.key(source)), self._split(self.value(source))
        weights = torch.softmax(q @ k.transpose(2, 3), dim=-1)
        x = x + self.out((weights @ v).transpose(1, 2).reshape(n, t, c))
        y: Tensor = x + self.forward_out(functional.relu(self.forward_in(self.norm_forward(x))))
        return y


class Distinction(nn.Module):
    """Makes the features of two images distinct: attention at 1/16, then fusion at 1/8."""

    def __init__(self, a: FlowArchitecture) -> None:
        super().__init__()
        self.within = nn.ModuleList(
            _Attention(a.width16, a.heads) for _ in range(a.attention_blocks)
        )
        self.across = nn.ModuleList(
            _Attention(a.width16, a.heads) for _ in range(a.attention_blocks)
        )
        self.place = nn.Conv2d(a.width16, a.width16, 3, padding=1, groups=a.width16)
        self.lateral = nn.Conv2d(a.width8, a.width16, 1)
        self.depthwise = nn.Conv2d(a.width16, a.width16, 3, padding=1, groups=a.width16)
        self.pointwise = nn.Conv2d(a.width16, a.width16, 1)

    def forward(self, first: Features, second: Features) -> tuple[Tensor, Tensor]:
        """Return two feature maps (N, 128, h8, w8)."""
        n, c, h, w = first.at16.shape
        both = torch.cat([first.at16, second.at16])
        x = (both + self.place(both)).flatten(2).transpose(1, 2)  # (2 N, h16 w16, 128)
        for within, across in zip(self.within, self.across, strict=True):
            x = within(x, x)
            x = across(x, torch.cat([x[n:], x[:n]]))
        coarse = x.transpose(1, 2).reshape(2 * n, c, h, w)
        y = self.lateral(torch.cat([first.at8, second.at8])) + double(coarse)
        y = y + self.pointwise(functional.relu(self.depthwise(functional.relu(y))))
        return y[:n], y[n:]
