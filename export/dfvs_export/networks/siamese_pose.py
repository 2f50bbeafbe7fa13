"""Pose between two images by a Siamese network, after Bateux et al. (ICRA 2018).

Both images go through an encoder of ImageNet, here EfficientNet-Lite0. Bateux et al. regress the
pose from the features of both at once. Here flow is regressed on the way, coarse to fine, and the
pose from flow. All cells of both images are compared (as in GMFlow, Xu et al., CVPR 2022). Then
those around what was found are, twice (a cost volume as in PWC-Net, Sun et al., CVPR 2018).
"""

from typing import NamedTuple

import torch
from torch import Tensor, nn
from torch.nn import functional

from dfvs_export.networks.efficientnet import CHANNELS, EfficientNetLite0
from dfvs_export.networks.pose_regression import SLOPE, PoseNet, PosePrediction, pose_head

RADIUS = 3
"""Of the cells around the flow so far that a refinement compares."""
UPDATES = 2
"""Refinements of the flow."""
STRIDE = 8
"""Of the grid that the pose is regressed from, px."""
_COARSE, _FINE = 64, 48
"""Channels of the descriptors at 1/8 and 1/4 of the image's size."""
_SPREAD = (-9.0, 0.5)
"""Logarithms of a spread that tell the pose something; smaller and larger ones are cut."""
_FIRST_SPREAD = -3.0
"""Logarithm of the spread that a training begins with."""


class Described(NamedTuple):
    """Descriptors of first and second images at 1/8 (2 B, 64, 18, 24) and 1/4 (2 B, 48, 36, 48)."""

    coarse: Tensor
    fine: Tensor


class Flow(NamedTuple):
    """Flow (B, 2, h, w) in widths, and the logarithm of its Laplace spread (B, 1, h, w)."""

    flow: Tensor
    spread: Tensor

    def doubled(self) -> "Flow":
        """Flow on a grid that is twice as fine."""
        return Flow(*(_upsampled(x) for x in self))

    def halved(self) -> "Flow":
        """Flow on a grid that is half as fine."""
        return Flow(*(functional.avg_pool2d(x, 2) for x in self))


class SiameseNet(PoseNet):
    """EfficientNet-Lite0 to 1/16 on either image, flow from both, pose from flow."""

    rotation = "vector"
    unit = "depth"

    def __init__(self) -> None:
        super().__init__()
        self.encoder = EfficientNetLite0(levels=4)
        self.lateral_16 = nn.Conv2d(CHANNELS[3], _COARSE, 1)
        self.lateral_8 = nn.Conv2d(CHANNELS[2], _COARSE, 1)
        self.describe_8 = nn.Sequential(
            _conv(_COARSE, _COARSE), nn.Conv2d(_COARSE, _COARSE, 3, 1, 1)
        )
        self.lateral_4 = nn.Conv2d(CHANNELS[1], _FINE, 1)
        self.reduce = nn.Conv2d(_COARSE, _FINE, 1)
        self.describe_4 = nn.Sequential(_conv(_FINE, _FINE), nn.Conv2d(_FINE, _FINE, 3, 1, 1))
        self.sharpness_8 = nn.Parameter(torch.tensor(3.0))
        self.sharpness_4 = nn.Parameter(torch.tensor(2.5))
        self.smooth = nn.Sequential(_conv(2 * _COARSE + 5, 96), _conv(96, 96), _conv(96, 96))
        self.smooth_head = _flow_head(96, _FIRST_SPREAD)
        compared = (2 * RADIUS + 1) ** 2
        self.update = nn.Sequential(
            _conv(compared + _FINE + 6, 96, 1), _conv(96, 64), _conv(64, 64), _conv(64, 64)
        )
        self.update_head = _flow_head(64, 0.0)
        self.summary = nn.Sequential(
            _conv(5, 64, 3, 2), _conv(64, 64), _conv(64, 64, 3, 2), nn.Flatten()
        )
        self.head = pose_head(64 * 5 * 6, 3)

    def describe(self, first: Tensor, second: Tensor) -> Described:
        """Descriptors of images (B, 1, 144, 192) in -1..1."""
        both = torch.cat([first, second]).expand(-1, 3, -1, -1)
        _, at_4, at_8, at_16 = self.encoder(both)
        merged = _upsampled(self.lateral_16(at_16)) + self.lateral_8(at_8)
        coarse = self.describe_8(functional.leaky_relu(merged, SLOPE))
        merged = _upsampled(self.reduce(coarse)) + self.lateral_4(at_4)
        return Described(coarse, self.describe_4(functional.leaky_relu(merged, SLOPE)))

    def similarity(self, coarse: Tensor) -> Tensor:
        """How alike all cells of first and second images are, (B, 432, 432), before a softmax."""
        first, second = _unit(coarse.flatten(2)).chunk(2)
        return self.sharpness_8.exp() * (first.transpose(1, 2) @ second)

    def first_flow(self, coarse: Tensor, similarity: Tensor) -> Flow:
        """Flow at 1/8: the mean over all cells, smoothed."""
        first, second = coarse.float().chunk(2)
        rows, columns = coarse.shape[2:]
        grid = _grid(rows, columns).flatten(1)
        share = similarity.softmax(2)
        mean = (share @ grid.T).transpose(1, 2) - grid
        confidence = share.amax(2)[:, None]
        told = torch.cat([mean, confidence, grid.expand(len(first), -1, -1)], 1)
        told = told.reshape(-1, 5, rows, columns)
        change = self.smooth_head(self.smooth(torch.cat([first, second, told], 1)))
        return Flow(told[:, :2] + change[:, :2], change[:, 2:])

    def refined(self, fine: Tensor, so_far: Flow) -> tuple[Flow, Tensor]:
        """Better flow at 1/4, and how alike each cell is to those around its flow so far.

        The latter (B, 49, 36, 48), before a softmax, goes row by row from the upper left. No
        gradient leads to the flow so far.
        """
        flow, spread = so_far.flow.detach(), so_far.spread.detach()
        first, second = _unit(fine).chunk(2)
        rows, columns = fine.shape[2:]
        to = 2.0 * (_grid(rows, columns) + flow)
        to = torch.stack([to[:, 0], to[:, 1] * (columns / rows)], 3)
        warped = functional.grid_sample(second, to, align_corners=False)
        around = functional.pad(warped, (RADIUS,) * 4)
        steps = range(2 * RADIUS + 1)
        shifted = [around[:, :, y : y + rows, x : x + columns] for y in steps for x in steps]
        alike = torch.stack([(first * other).sum(1) for other in shifted], 1)
        similarity = self.sharpness_4.exp() * alike
        share = similarity.softmax(1)
        mean = (share.permute(0, 2, 3, 1) @ _window()).permute(0, 3, 1, 2)
        confidence = share.amax(1, keepdim=True)
        relative = 10.0 * (flow - flow.mean((2, 3), keepdim=True))
        told = [similarity / 4.0, 7.0 * first, mean, confidence, relative, spread]
        change = self.update_head(self.update(torch.cat(told, 1))).float()
        better = flow + (confidence * mean + change[:, :2]) / columns
        return Flow(better, spread + change[:, 2:]), similarity

    def regress(self, found: Flow, focal: Tensor) -> PosePrediction:
        """Pose from flow on a grid of 8 px."""
        k = focal[:, :, None, None]
        grid = _grid(*found.flow.shape[2:]).expand(len(k), -1, -1, -1)
        spread = -0.5 * (found.spread.clamp(*_SPREAD) + 4.0)
        out = self.head(self.summary(torch.cat([4.0 * found.flow / k, grid / k, spread], 1)))
        return PosePrediction(out[:, :3], out[:, 3:])

    def forward(self, first: Tensor, second: Tensor, focal: Tensor) -> PosePrediction:
        """Pose of images (B, 1, 144, 192) in -1..1 of a focal length (B, 1) over the width."""
        coarse, fine = self.describe(first, second)
        found = self.first_flow(coarse, self.similarity(coarse)).doubled()
        for _ in range(UPDATES):
            found, _ = self.refined(fine, found)
        return self.regress(found.halved(), focal)


def _conv(inputs: int, outputs: int, kernel: int = 3, stride: int = 1) -> nn.Sequential:
    conv = nn.Conv2d(inputs, outputs, kernel, stride, kernel // 2)
    return nn.Sequential(conv, nn.LeakyReLU(SLOPE))


def _flow_head(features: int, spread: float) -> nn.Conv2d:
    """Layer that gives flow and spread, to begin with no flow and this spread."""
    head = nn.Conv2d(features, 3, 1)
    nn.init.zeros_(head.weight)
    head.bias = nn.Parameter(torch.tensor([0.0, 0.0, spread]))
    return head


def _unit(descriptors: Tensor) -> Tensor:
    return functional.normalize(descriptors.float(), dim=1)


def _upsampled(x: Tensor) -> Tensor:
    return functional.interpolate(x, scale_factor=2, mode="bilinear")


def _grid(rows: int, columns: int) -> Tensor:
    """Middles (2, rows, columns) of cells as (x, y), in widths from the image's middle."""
    x, y = (torch.arange(n, dtype=torch.float32) + 0.5 - 0.5 * n for n in (columns, rows))
    x, y = x / columns, y / columns
    return torch.stack([x.expand(rows, -1), y[:, None].expand(-1, columns)])


def _window() -> Tensor:
    """Steps (49, 2) as (x, y), in cells, to those that a refinement compares."""
    steps = torch.arange(-RADIUS, RADIUS + 1, dtype=torch.float32)
    y, x = torch.meshgrid(steps, steps, indexing="ij")
    return torch.stack([x, y], 2).flatten(0, 1)
