"""MiDaS v2.1 small: an EfficientNet-Lite3 encoder and a decoder of feature fusions.

R. Ranftl et al., "Towards Robust Monocular Depth Estimation", TPAMI 2022. Parameters are named as
in the published checkpoint ``midas_v21_small_256.pt``. The encoder comes from ``geffnet``.
"""

import importlib

from torch import Tensor, nn
from torch.nn.functional import interpolate

from dfvs_core.errors import ConfigError

_ENCODED = (32, 48, 136, 384)
"""Channels of the encoder at 1/4, 1/8, 1/16 and 1/32."""
_WIDTHS = (64, 128, 256, 512)
_HEAD = 32


class _Residual(nn.Module):
    def __init__(self, width: int) -> None:
        super().__init__()
        self.conv1 = nn.Conv2d(width, width, 3, padding=1)
        self.conv2 = nn.Conv2d(width, width, 3, padding=1)

    def forward(self, x: Tensor) -> Tensor:
        residual: Tensor = self.conv2(self.conv1(x.relu()).relu())
        return residual + x


class _Fusion(nn.Module):
    """Twice the size, with the encoder's features where they are given."""

    def __init__(self, width: int, outputs: int) -> None:
        super().__init__()
        self.out_conv = nn.Conv2d(width, outputs, 1)
        self.resConfUnit1 = _Residual(width)
        self.resConfUnit2 = _Residual(width)

    def forward(self, x: Tensor, skip: Tensor | None = None) -> Tensor:
        if skip is not None:
            x = x + self.resConfUnit1(skip)
        x = self.resConfUnit2(x)
        up = interpolate(x, scale_factor=2.0, mode="bilinear", align_corners=True)
        fused: Tensor = self.out_conv(up)
        return fused


class MidasSmall(nn.Module):
    """Image (1, 3, H, W), normalised as ImageNet's, to inverse depth (1, H, W), affine.

    H and W are multiples of 32.

    Raises
    ------
    ConfigError
        If the package of the encoder is not installed.
    """

    def __init__(self) -> None:
        super().__init__()
        self.pretrained = _encoder()
        self.scratch = nn.Module()
        below = (*_WIDTHS[:1], *_WIDTHS[:-1])
        for k, (encoded, width, outputs) in enumerate(zip(_ENCODED, _WIDTHS, below, strict=True)):
            convolution = nn.Conv2d(encoded, width, 3, padding=1, bias=False)
            self.scratch.add_module(f"layer{k + 1}_rn", convolution)
            self.scratch.add_module(f"refinenet{k + 1}", _Fusion(width, outputs))
        self.scratch.output_conv = nn.Sequential(
            nn.Conv2d(_WIDTHS[0], _WIDTHS[0] // 2, 3, padding=1),
            nn.Upsample(scale_factor=2.0, mode="bilinear", align_corners=False),
            nn.Conv2d(_WIDTHS[0] // 2, _HEAD, 3, padding=1),
            nn.ReLU(),
            nn.Conv2d(_HEAD, 1, 1),
            nn.ReLU(),
        )

    def forward(self, image: Tensor) -> Tensor:
        """Inverse depth, larger where it is nearer, 0 or more."""
        x, features = image, []
        for layer in self.pretrained.children():
            x = layer(x)
            features.append(x)
        parts = dict(self.scratch.named_children())
        path = None
        for k in reversed(range(len(features))):
            skip = parts[f"layer{k + 1}_rn"](features[k])
            fusion = parts[f"refinenet{k + 1}"]
            path = fusion(skip) if path is None else fusion(path, skip)
        inverse_depth: Tensor = parts["output_conv"](path)
        return inverse_depth[:, 0]


def _encoder() -> nn.Module:
    """Four stages of EfficientNet-Lite3, with random weights."""
    try:
        geffnet = importlib.import_module("geffnet")
    except ImportError as error:
        raise ConfigError(
            f"the package geffnet cannot be imported ({error})",
            "it, for the encoder of midas-small (EfficientNet-Lite3)",
            "pip install 'dfvs-lab[published-depth]'",
        ) from error
    network = geffnet.tf_efficientnet_lite3(pretrained=False, exportable=True)
    blocks = list(network.blocks)
    stages = nn.Module()
    stages.layer1 = nn.Sequential(network.conv_stem, network.bn1, network.act1, *blocks[:2])
    stages.layer2 = nn.Sequential(*blocks[2:3])
    stages.layer3 = nn.Sequential(*blocks[3:5])
    stages.layer4 = nn.Sequential(*blocks[5:9])
    return stages
