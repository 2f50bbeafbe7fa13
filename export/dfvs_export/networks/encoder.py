"""An image becomes features, so that a fixed goal picture costs nothing per frame."""

from __future__ import annotations

from dataclasses import dataclass

import torch
from torch import Tensor, nn
from torch.nn import functional

from dfvs_export.networks.architecture import FlowArchitecture
from dfvs_export.networks.sampling import double


@dataclass(frozen=True, slots=True)
class Features:
    """What ``encode`` returns.

    (N, 128, h16, w16), (N, 96, h8, w8), (N, 64, h4, w4) and the normalised image (N, 4, H, W),
    which is warped and encoded anew at 1/4.
    """

    at16: Tensor
    at8: Tensor
    at4: Tensor
    image: Tensor

    def __getitem__(self, which: Tensor) -> Features:
        """Features of some of the images."""
        return Features(self.at16[which], self.at8[which], self.at4[which], self.image[which])


def _conv(channels: int, out: int, kernel: int, stride: int = 1) -> nn.Sequential:
    """Convolution, batch normalisation (folded away at export) and ReLU."""
    conv = nn.Conv2d(channels, out, kernel, stride, kernel // 2, bias=False)
    return nn.Sequential(conv, nn.BatchNorm2d(out), nn.ReLU())


class _Residual(nn.Module):
    """Two 3 x 3 convolutions around a shortcut; (N, C, h, w) to the same."""

    def __init__(self, channels: int) -> None:
        super().__init__()
        self.first = _conv(channels, channels, 3)
        self.second = nn.Conv2d(channels, channels, 3, padding=1, bias=False)
        self.norm = nn.BatchNorm2d(channels)

    def forward(self, x: Tensor) -> Tensor:
        y: Tensor = functional.relu(x + self.norm(self.second(self.first(x))))
        return y


class Encoder(nn.Module):
    """Image to features at 1/16, 1/8 and 1/4."""

    def __init__(self, a: FlowArchitecture) -> None:
        super().__init__()
        self.stem = _conv(4, a.width2, 5, 2)
        self.to4 = nn.Sequential(_conv(a.width2, a.width4, 3, 2), _Residual(a.width4))
        self.to8 = nn.Sequential(_conv(a.width4, a.width8, 3, 2), _Residual(a.width8))
        self.to16 = nn.Sequential(
            _conv(a.width8, a.width16, 3, 2), _Residual(a.width16), _Residual(a.width16)
        )
        fine = 2 * a.fine_channels
        self.lateral4 = nn.Conv2d(a.width4, fine, 1)
        self.lateral8 = nn.Conv2d(a.width8, fine, 1)
        self.fine = nn.Conv2d(fine, fine, 3, padding=1)

    def forward(self, image: Tensor) -> Features:
        """Image (N, 3, H, W) in [0, 1] to features."""
        normal = normalise(image)
        x8, fine = self.encode_finely(normal)
        return Features(self.to16(x8), x8, fine, normal)

    def encode_finely(self, image: Tensor) -> tuple[Tensor, Tensor]:
        """Features at 1/8 and 1/4 of a normalised image (N, 4, H, W)."""
        x4 = self.to4(self.stem(image))
        x8 = self.to8(x4)
        return x8, self.fine(functional.relu(self.lateral4(x4) + double(self.lateral8(x8))))


def normalise(image: Tensor) -> Tensor:
    """Take exposure and contrast out: (N, 3, H, W) in [0, 1] to (N, 4, H, W).

    Three channels are normalised over the image, the fourth over a neighbourhood of some 24 px,
    where dark plain walls show what texture they have.
    """
    mean = _mean(image)
    deviation = _mean((image - mean) ** 2).sqrt()
    grey = image[:, :1] + image[:, 1:2] + image[:, 2:]  # runtimes are slow with means of channels
    grey = grey * (1.0 / 3.0) - mean  # small numbers lose less to rounding below
    centred = grey - _blurred(grey)
    contrast = centred / (_blurred(centred * centred) + 2e-4).sqrt()
    return torch.cat([(image - mean) / (deviation + 0.03), contrast], 1)


def _mean(x: Tensor) -> Tensor:
    """Mean (N, 1, 1, 1) of x, by way of blocks: long sums in float32 differ between runtimes."""
    return functional.avg_pool2d(x, 8).mean((1, 2, 3), keepdim=True)


def _blurred(x: Tensor) -> Tensor:
    """Mean of x (N, 1, H, W) over some 24 px, by way of 1/8 of the resolution."""
    blocks = functional.avg_pool2d(functional.avg_pool2d(x, 8), 3, 1, 1, count_include_pad=False)
    return functional.interpolate(blocks, scale_factor=8.0, mode="bilinear", align_corners=False)
