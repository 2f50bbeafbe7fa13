"""dfvs-depth: inverse depth of one image, with its uncertainty.

The encoder is EfficientNet-Lite0; the decoder is that of DenseDepth (Alhashim and Wonka, 2018):
up-sampling, concatenation with the encoder's features, two convolutions. What is predicted is
inverse depth times focal length, which does not depend on the camera (Metric3D, Yin et al., ICCV
2023); the focal length is an input and is divided out at the end.
"""

from typing import NamedTuple

import torch
from torch import Tensor, nn
from torch.nn import functional

from dfvs_export.networks.efficientnet import CHANNELS, EfficientNetLite0

SIZE = (320, 240)
"""Of the image, px (width, height)."""
STRIDE = 2
"""Of the output's grid, px of the image."""
NORMALS_STRIDE = 4

_WIDTHS = (96, 48, 32, 16)
"""Channels of the decoder at 1/16, 1/8, 1/4 and 1/2."""
_LUMA = (0.299, 0.587, 0.114)
_ROWS = 256
"""Of the image that the encoder sees, padded to a multiple of 32."""
_LOG_RANGE = (-3.5, 3.5)
"""Of ln(inverse depth times focal length)."""
_LOG_SIGMA_RANGE = (-4.0, 1.0)
_START_LOG = -1.2


class Prediction(NamedTuple):
    """ln(inverse depth) and ln(sigma) (B, 120, 160), and normals (B, 3, 60, 80) of any length."""

    log: Tensor
    log_sigma: Tensor
    normals: Tensor


class DepthNet(nn.Module):
    """Images of ``SIZE`` to inverse depth and its uncertainty at half of the size.

    Colours are averaged first, so that cameras without any are no other case.
    """

    def __init__(self) -> None:
        super().__init__()
        self.encoder = EfficientNetLite0()
        self.reduce = _conv(CHANNELS[4], _WIDTHS[0], 1)
        inputs, skips = (_WIDTHS[0], *_WIDTHS[:-1]), CHANNELS[3::-1]
        self.steps = nn.ModuleList(
            nn.Sequential(_conv(below + skip, width), _conv(width, width))
            for below, skip, width in zip(inputs, skips, _WIDTHS, strict=True)
        )
        self.head = nn.Conv2d(_WIDTHS[3], 2, 3, 1, 1)
        self.normals = nn.Conv2d(_WIDTHS[2], 3, 3, 1, 1)
        nn.init.normal_(self.head.weight, std=0.01)
        self.head.bias = nn.Parameter(torch.tensor([_START_LOG, -1.0]))

    def forward(self, image: Tensor, focal: Tensor) -> tuple[Tensor, Tensor]:
        """Inverse depth (B, 120, 160) 1/m and sigma (B, 120, 160) of its logarithm.

        ``image`` (B, 3, 240, 320) is RGB, 0 to 1; ``focal`` (B, 1) is the focal length over the
        image's width. Depth is along the optical axis.
        """
        log, log_sigma, _ = self.logs(image, focal)
        return log.exp(), log_sigma.exp()

    def logs(self, image: Tensor, focal: Tensor) -> Prediction:
        """Logarithms of both, and normals of the surface, which only training needs."""
        grey = (image * image.new_tensor(_LUMA).view(1, 3, 1, 1)).sum(dim=1, keepdim=True)
        rows = image.shape[2]
        above = (_ROWS - rows) // 2
        padded = functional.pad(grey, (0, 0, above, _ROWS - rows - above), mode="replicate")
        features = self.encoder((2.0 * padded - 1.0).expand(-1, 3, -1, -1))
        x, normals = self.reduce(features[4]), features[4]
        for skip, step in zip(features[3::-1], self.steps, strict=True):
            x = step(torch.cat([functional.interpolate(x, scale_factor=2.0), skip], dim=1))
            if x.shape[1] == _WIDTHS[2]:
                normals = x
        first = above // STRIDE
        out = self.head(x)[:, :, first : first + rows // STRIDE].float()
        log = out[:, 0].clamp(*_LOG_RANGE) - focal.log().unsqueeze(2)
        first = above // NORMALS_STRIDE
        seen = self.normals(normals)[:, :, first : first + rows // NORMALS_STRIDE]
        return Prediction(log, out[:, 1].clamp(*_LOG_SIGMA_RANGE), seen)


def _conv(inputs: int, outputs: int, kernel: int = 3) -> nn.Sequential:
    return nn.Sequential(
        nn.Conv2d(inputs, outputs, kernel, 1, kernel // 2, bias=False),
        nn.BatchNorm2d(outputs),
        nn.ReLU(),
    )
