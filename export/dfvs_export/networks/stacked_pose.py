"""Pose between two images by a network on both of them stacked, after Saxena et al. (ICRA 2017).

Saxena et al. regress the pose by FlowNet's encoder (FlowNetSimple, Dosovitskiy et al., ICCV 2015)
on both images stacked. Here the stacked images lead to flow from coarse to fine, and flow leads to
the pose. Each level sees the second image as the level before has moved it (SpyNet, Ranjan and
Black, CVPR 2017).
"""

import torch
from torch import Tensor, nn
from torch.nn import functional

from dfvs_export.networks.pose_regression import (
    Flow,
    PoseNet,
    PosePrediction,
    conv,
    flow_head,
    warped,
)

LEVELS = (16, 8, 4)
"""Strides of the flow so far, px: sizes of the images that a level sees are that much smaller."""
_KERNELS = (7, 7, 5)
_FIRST_SPREAD = -3.0
"""Logarithm of the spread that the coarsest level starts from."""
_WINDOW, _CONTRAST = 5, 0.004
"""Pixels about one that its brightness is set against, and the variance that is no contrast."""


class StackedNet(PoseNet):
    """Levels of a pyramid on stacked images, pose from flow."""

    def __init__(self) -> None:
        super().__init__()
        self.levels = nn.ModuleList([_level(kernel) for kernel in _KERNELS])

    def flows(self, first: Tensor, second: Tensor) -> list[Flow]:
        """Flow of images (B, 1, 144, 192) in -1..1 at 1/16, 1/8 and 1/4 of their size.

        No gradient leads from a level to the one before.
        """
        found = list[Flow]()
        for stride, level in zip(LEVELS, self.levels, strict=True):
            images = [_contrast(functional.avg_pool2d(x, stride)) for x in (first, second)]
            if found:
                flow, spread = (x.detach() for x in found[-1].doubled())
            else:
                flow = torch.zeros_like(images[0]).expand(-1, 2, -1, -1)
                spread = torch.full_like(images[0], _FIRST_SPREAD)
            moved, to = warped(images[1], flow)
            inside = (to.abs() < 1.0).all(3)[:, None].float()
            seen = torch.cat([images[0], moved, inside, 4.0 * flow, spread], 1)
            change = level(seen).float()
            found.append(Flow(flow + change[:, :2] / seen.shape[3], spread + change[:, 2:]))
        return found

    def forward(self, first: Tensor, second: Tensor, focal: Tensor) -> PosePrediction:
        """Pose of images (B, 1, 144, 192) in -1..1 of a focal length (B, 1) over the width."""
        return self.regress(self.flows(first, second)[-1].halved(), focal)


def _level(kernel: int) -> nn.Sequential:
    return nn.Sequential(
        conv(6, 32, kernel),
        conv(32, 64, kernel),
        conv(64, 64),
        conv(64, 32, kernel),
        flow_head(32, 0.0),
    )


def _contrast(image: Tensor) -> Tensor:
    """Brightness less that around it, over the contrast there."""
    apart = image - _mean(image)
    return apart / (_mean(apart * apart) + _CONTRAST).sqrt()


def _mean(image: Tensor) -> Tensor:
    return functional.avg_pool2d(image, _WINDOW, 1, _WINDOW // 2, count_include_pad=False)
