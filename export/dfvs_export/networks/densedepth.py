"""DenseDepth: a DenseNet-169 encoder and a decoder of up-sampling, skips and two convolutions.

I. Alhashim and P. Wonka, "High Quality Monocular Depth Estimation via Transfer Learning", 2018; the
encoder after G. Huang et al., "Densely Connected Convolutional Networks", CVPR 2017.
"""

import torch
from torch import Tensor, nn
from torch.nn.functional import interpolate, leaky_relu

_GROWTH = 32
_BLOCKS = (6, 12, 32, 32)
_STEM = 64
_EPSILON = 1.001e-5
_SLOPE = 0.2
_DEPTH_FACTOR = 10.0
"""The network gives 10 m over the depth."""
NEAREST_M, FARTHEST_M = 0.1, 10.0
"""Range of the depth that it was trained on."""


class _Layer(nn.Module):
    """(1, C, h, w) to (1, C + 32, h, w)."""

    def __init__(self, channels: int) -> None:
        super().__init__()
        self.layers = nn.Sequential(
            nn.BatchNorm2d(channels, eps=_EPSILON),
            nn.ReLU(),
            nn.Conv2d(channels, 4 * _GROWTH, 1, bias=False),
            nn.BatchNorm2d(4 * _GROWTH, eps=_EPSILON),
            nn.ReLU(),
            nn.Conv2d(4 * _GROWTH, _GROWTH, 3, padding=1, bias=False),
        )

    def forward(self, x: Tensor) -> Tensor:
        return torch.cat([x, self.layers(x)], dim=1)


def _transition(channels: int) -> nn.Sequential:
    """Half of the channels at half of the resolution."""
    return nn.Sequential(
        nn.BatchNorm2d(channels, eps=_EPSILON),
        nn.ReLU(),
        nn.Conv2d(channels, channels // 2, 1, bias=False),
        nn.AvgPool2d(2),
    )


class DenseNet169(nn.Module):
    """Encoder: (1, 3, H, W) to features of five resolutions."""

    def __init__(self) -> None:
        super().__init__()
        self.stem = nn.Sequential(
            nn.Conv2d(3, _STEM, 7, stride=2, padding=3, bias=False),
            nn.BatchNorm2d(_STEM, eps=_EPSILON),
            nn.ReLU(),
        )
        self.pool = nn.MaxPool2d(3, stride=2, padding=1)
        self.blocks, self.transitions = nn.ModuleList(), nn.ModuleList()
        self.channels = [_STEM, _STEM]
        """Of the features, finest first."""
        channels = _STEM
        for k, count in enumerate(_BLOCKS):
            self.blocks.append(
                nn.Sequential(*(_Layer(channels + n * _GROWTH) for n in range(count)))
            )
            channels += count * _GROWTH
            if k + 1 < len(_BLOCKS):
                self.transitions.append(_transition(channels))
                channels //= 2
                self.channels.append(channels)
        self.channels[-1] = channels
        self.last = nn.Sequential(nn.BatchNorm2d(channels, eps=_EPSILON), nn.ReLU())

    def forward(self, x: Tensor) -> list[Tensor]:
        """Features at 1/2, 1/4, 1/8, 1/16 and 1/32 of the size."""
        features = [self.stem(x)]
        features.append(self.pool(features[-1]))
        for block, transition in zip(self.blocks, self.transitions, strict=False):
            features.append(transition(block(features[-1])))
        *skips, last = features
        return [*skips, self.last(self.blocks[-1](last))]


class _UpSampling(nn.Module):
    """Twice the size, joined with the encoder's features, and two convolutions."""

    def __init__(self, channels: int, skip: int, filters: int) -> None:
        super().__init__()
        self.first = nn.Conv2d(channels + skip, filters, 3, padding=1)
        self.second = nn.Conv2d(filters, filters, 3, padding=1)

    def forward(self, x: Tensor, skip: Tensor) -> Tensor:
        up = interpolate(x, scale_factor=2.0, mode="bilinear", align_corners=False)
        joined = leaky_relu(self.first(torch.cat([up, skip], dim=1)), _SLOPE)
        return leaky_relu(self.second(joined), _SLOPE)


class DenseDepth(nn.Module):
    """Image (1, 3, H, W), RGB 0 to 1, to inverse depth (1, H / 2, W / 2), 1/m.

    H and W are multiples of 32.
    """

    def __init__(self) -> None:
        super().__init__()
        self.encoder = DenseNet169()
        *skips, filters = self.encoder.channels
        self.bridge = nn.Conv2d(filters, filters, 1)
        self.ups = nn.ModuleList(
            _UpSampling(filters >> k, skip, filters >> (k + 1))
            for k, skip in enumerate(reversed(skips))
        )
        self.head = nn.Conv2d(filters >> len(skips), 1, 3, padding=1)

    def forward(self, image: Tensor) -> Tensor:
        """Inverse depth within the range of the training."""
        *skips, deepest = self.encoder(image)
        x = self.bridge(deepest)
        for up, skip in zip(self.ups, reversed(skips), strict=True):
            x = up(x, skip)
        inverse_depth: Tensor = self.head(x)[:, 0] / _DEPTH_FACTOR
        return inverse_depth.clamp(1.0 / FARTHEST_M, 1.0 / NEAREST_M)
