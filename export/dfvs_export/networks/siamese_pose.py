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
from dfvs_export.networks.pose_regression import (
    SLOPE,
    Flow,
    PoseNet,
    PosePrediction,
    conv,
    flow_head,
    grid,
    upsampled,
    warped,
)

RADIUS = 3
"""Of the cells around the flow so far that a refinement compares."""
UPDATES = 2
"""Refinements of the flow."""
_COARSE, _FINE = 64, 48
"""Channels of the descriptors at 1/8 and 1/4 of the image's size."""
_FIRST_SPREAD = -3.0
"""Logarithm of the spread that a training begins with."""


class Described(NamedTuple):
    """Descriptors of first and second images at 1/8 (2 B, 64, 18, 24) and 1/4 (2 B, 48, 36, 48)."""

    coarse: Tensor
    fine: Tensor


class SiameseNet(PoseNet):
    """EfficientNet-Lite0 to 1/16 on either image, flow from both, pose from flow."""

    def __init__(self) -> None:
        super().__init__()
        self.encoder = EfficientNetLite0(levels=4)
        self.lateral_16 = nn.Conv2d(CHANNELS[3], _COARSE, 1)
        self.lateral_8 = nn.Conv2d(CHANNELS[2], _COARSE, 1)
        self.describe_8 = nn.Sequential(
            conv(_COARSE, _COARSE), nn.Conv2d(_COARSE, _COARSE, 3, 1, 1)
        )
        self.lateral_4 = nn.Conv2d(CHANNELS[1], _FINE, 1)
        self.reduce = nn.Conv2d(_COARSE, _FINE, 1)
        self.describe_4 = nn.Sequential(conv(_FINE, _FINE), nn.Conv2d(_FINE, _FINE, 3, 1, 1))
        self.sharpness_8 = nn.Parameter(torch.tensor(3.0))
        self.sharpness_4 = nn.Parameter(torch.tensor(2.5))
        self.smooth = nn.Sequential(conv(2 * _COARSE + 5, 96), conv(96, 96), conv(96, 96))
        self.smooth_head = flow_head(96, _FIRST_SPREAD)
        compared = (2 * RADIUS + 1) ** 2
        self.update = nn.Sequential(
            conv(compared + _FINE + 6, 96, 1), conv(96, 64), conv(64, 64), conv(64, 64)
        )
        self.update_head = flow_head(64, 0.0)

    def describe(self, first: Tensor, second: Tensor) -> Described:
        """Descriptors of images (B, 1, 144, 192) in -1..1."""
        both = torch.cat([first, second]).expand(-1, 3, -1, -1)
        _, at_4, at_8, at_16 = self.encoder(both)
        merged = upsampled(self.lateral_16(at_16)) + self.lateral_8(at_8)
        coarse = self.describe_8(functional.leaky_relu(merged, SLOPE))
        merged = upsampled(self.reduce(coarse)) + self.lateral_4(at_4)
        return Described(coarse, self.describe_4(functional.leaky_relu(merged, SLOPE)))

    def similarity(self, coarse: Tensor) -> Tensor:
        """How alike all cells of first and second images are, (B, 432, 432), before a softmax."""
        first, second = _unit(coarse.flatten(2)).chunk(2)
        return self.sharpness_8.exp() * (first.transpose(1, 2) @ second)

    def first_flow(self, coarse: Tensor, similarity: Tensor) -> Flow:
        """Flow at 1/8: the mean over all cells, smoothed."""
        first, second = coarse.float().chunk(2)
        rows, columns = coarse.shape[2:]
        cells = grid(rows, columns).flatten(1)
        share = similarity.softmax(2)
        mean = (share @ cells.T).transpose(1, 2) - cells
        confidence = share.amax(2)[:, None]
        told = torch.cat([mean, confidence, cells.expand(len(first), -1, -1)], 1)
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
        moved, _ = warped(second, flow)
        around = functional.pad(moved, (RADIUS,) * 4)
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

    def forward(self, first: Tensor, second: Tensor, focal: Tensor) -> PosePrediction:
        """Pose of images (B, 1, 144, 192) in -1..1 of a focal length (B, 1) over the width."""
        coarse, fine = self.describe(first, second)
        found = self.first_flow(coarse, self.similarity(coarse)).doubled()
        for _ in range(UPDATES):
            found, _ = self.refined(fine, found)
        return self.regress(found.halved(), focal)


def _unit(descriptors: Tensor) -> Tensor:
    return functional.normalize(descriptors.float(), dim=1)


def _window() -> Tensor:
    """Steps (49, 2) as (x, y), in cells, to those that a refinement compares."""
    steps = torch.arange(-RADIUS, RADIUS + 1, dtype=torch.float32)
    y, x = torch.meshgrid(steps, steps, indexing="ij")
    return torch.stack([x, y], 2).flatten(0, 1)
