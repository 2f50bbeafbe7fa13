"""What networks that regress the pose between two images have in common: flow to pose.

Both networks work out flow between the images on the way, and regress the pose from that.
"""

from typing import NamedTuple

import torch
from torch import Tensor, nn
from torch.nn import functional

SIZE = (192, 144)
"""Of both images, px (width, height)."""
SLOPE = 0.1
"""Of leaky rectifiers below 0."""
STRIDE = 8
"""Of the grid that the pose is regressed from, px."""
_SPREAD = (-9.0, 0.5)
"""Logarithms of a spread that tell the pose something; smaller and larger ones are cut."""


class PosePrediction(NamedTuple):
    """Translation (B, 3) in depths of the second image, and rotation vector (B, 3) in rad."""

    translation: Tensor
    rotation: Tensor


class Flow(NamedTuple):
    """Flow (B, 2, h, w) in widths, and the logarithm of its Laplace spread (B, 1, h, w)."""

    flow: Tensor
    spread: Tensor

    def doubled(self) -> "Flow":
        """Flow on a grid that is twice as fine."""
        return Flow(*(upsampled(x) for x in self))

    def halved(self) -> "Flow":
        """Flow on a grid that is half as fine."""
        return Flow(*(functional.avg_pool2d(x, 2) for x in self))


class PoseNet(nn.Module):
    """Two images to the pose of the second camera in the first, by way of flow."""

    def __init__(self) -> None:
        super().__init__()
        self.summary = nn.Sequential(
            conv(5, 64, 3, 2), conv(64, 64), conv(64, 64, 3, 2), nn.Flatten()
        )
        last = nn.Linear(512, 6)
        nn.init.normal_(last.weight, std=0.01)
        nn.init.zeros_(last.bias)
        self.head = nn.Sequential(nn.Linear(64 * 5 * 6, 512), nn.LeakyReLU(SLOPE), last)

    def regress(self, found: Flow, focal: Tensor) -> PosePrediction:
        """Pose from flow on a grid of 8 px, and the focal length (B, 1) over the width."""
        k = focal[:, :, None, None]
        where = grid(*found.flow.shape[2:]).expand(len(k), -1, -1, -1)
        spread = -0.5 * (found.spread.clamp(*_SPREAD) + 4.0)
        out = self.head(self.summary(torch.cat([4.0 * found.flow / k, where / k, spread], 1)))
        return PosePrediction(out[:, :3], out[:, 3:])

    def forward(self, first: Tensor, second: Tensor, focal: Tensor) -> PosePrediction:
        """Pose of images (B, 1, 144, 192) in -1..1 of a focal length (B, 1) over the width."""
        raise NotImplementedError


def conv(inputs: int, outputs: int, kernel: int = 3, stride: int = 1) -> nn.Sequential:
    """Convolution and leaky rectifier."""
    layer = nn.Conv2d(inputs, outputs, kernel, stride, kernel // 2)
    return nn.Sequential(layer, nn.LeakyReLU(SLOPE))


def flow_head(features: int, spread: float) -> nn.Conv2d:
    """Layer that gives flow and spread, to begin with no flow and this spread."""
    head = nn.Conv2d(features, 3, 1)
    nn.init.zeros_(head.weight)
    head.bias = nn.Parameter(torch.tensor([0.0, 0.0, spread]))
    return head


def upsampled(x: Tensor) -> Tensor:
    """Twice as fine."""
    return functional.interpolate(x, scale_factor=2, mode="bilinear")


def grid(rows: int, columns: int) -> Tensor:
    """Middles (2, rows, columns) of cells as (x, y), in widths from the image's middle."""
    x, y = (torch.arange(n, dtype=torch.float32) + 0.5 - 0.5 * n for n in (columns, rows))
    x, y = x / columns, y / columns
    return torch.stack([x.expand(rows, -1), y[:, None].expand(-1, columns)])


def warped(second: Tensor, flow: Tensor) -> tuple[Tensor, Tensor]:
    """What flow (B, 2, h, w) leads to in (B, c, h, w), and where, (B, h, w, 2) from -1 to 1."""
    rows, columns = second.shape[2:]
    to = 2.0 * (grid(rows, columns) + flow)
    to = torch.stack([to[:, 0], to[:, 1] * (columns / rows)], 3)
    return functional.grid_sample(second, to, align_corners=False), to
