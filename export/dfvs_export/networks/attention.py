"""Attention within and across two images, which makes repeated things distinct."""

from __future__ import annotations

import torch
from torch import Tensor, nn
from torch.nn import functional

from dfvs_export.networks.architecture import FlowArchitecture
from dfvs_export.networks.encoder import Features
from dfvs_export.networks.sampling import double


class _Attention(nn.Module):
    """Pre-norm attention of tokens within an image or to another's, then a feed-forward part."""

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

    def _queries_keys_values(self, x: Tensor) -> tuple[Tensor, Tensor, Tensor]:
        """Of tokens (N, T, C), each (N, heads, T, C / heads), by one product.

        What normalisation scales and shifts, and the scale of the queries, goes into the weights.
        """
        n, t, c = x.shape
        scale = (c // self.heads) ** -0.5
        query, source = self.norm_query, self.norm_source
        weights, biases = [], []
        for norm, layer, factor in (
            (query, self.query, scale),
            (source, self.key, 1.0),
            (source, self.value, 1.0),
        ):
            weights.append(layer.weight * (factor * norm.weight))
            biases.append((layer.weight @ norm.bias + layer.bias) * factor)
        normal = functional.layer_norm(x, (c,), eps=query.eps)
        made = functional.linear(normal, torch.cat(weights), torch.cat(biases))
        heads = made.reshape(n, t, 3, self.heads, c // self.heads).permute(2, 0, 3, 1, 4)
        return heads[0], heads[1], heads[2]

    def forward(self, x: Tensor, crossed: bool) -> Tensor:
        """Attend to the tokens (2 N, T, C) themselves, or to those of the other image."""
        n, t, c = x.shape
        q, k, v = self._queries_keys_values(x)
        if crossed:
            k, v = (torch.cat([side[n // 2 :], side[: n // 2]]) for side in (k, v))
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
            x = across(within(x, crossed=False), crossed=True)
        coarse = x.transpose(1, 2).reshape(2 * n, c, h, w)
        y = self.lateral(torch.cat([first.at8, second.at8])) + double(coarse)
        y = y + self.pointwise(functional.relu(self.depthwise(functional.relu(y))))
        return y[:n], y[n:]
