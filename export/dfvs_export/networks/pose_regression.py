"""Networks that regress the pose between two images, and the one after Saxena et al. (ICRA 2017).

``StackedNet`` is FlowNet's encoder (FlowNetSimple, Dosovitskiy et al., ICCV 2015) on both images
stacked, then translation and quaternion. Two things are added: flow on a coarse grid is predicted
on the way, and learnt, which stands for FlowNet's pretraining; and the focal length goes in beside
the features, for cameras of any.
"""

from typing import Literal, NamedTuple

import torch
from torch import Tensor, nn

SIZE = (192, 144)
"""Of both images, px (width, height)."""
SLOPE = 0.1
"""Of leaky rectifiers below 0."""


class PosePrediction(NamedTuple):
    """Translation (B, 3), and rotation: quaternion (B, 4) of any length or vector (B, 3) rad."""

    translation: Tensor
    rotation: Tensor


class PoseNet(nn.Module):
    """Two images to the pose of the second camera in the first.

    ``unit`` is that of the translation: m, or depths at the second image's middle.
    """

    rotation: Literal["quaternion", "vector"]
    unit: Literal["m", "depth"]

    def forward(self, first: Tensor, second: Tensor, focal: Tensor) -> PosePrediction:
        """Pose of images (B, 1, 144, 192) in -1..1 of a focal length (B, 1) over the width."""
        raise NotImplementedError


class StackedNet(PoseNet):
    """FlowNet's encoder with half of its channels, and batch normalisation, on stacked images."""

    STRIDE = 16
    """Of the grid that flow is predicted on, px."""
    rotation = "quaternion"
    unit = "m"

    def __init__(self) -> None:
        super().__init__()
        self.begin = nn.Sequential(
            _conv(2, 32, 7, 2),
            _conv(32, 64, 5, 2),
            _conv(64, 128, 5, 2),
            _conv(128, 128),
            _conv(128, 256, 3, 2),
            _conv(256, 256),
        )
        self.flow_head = nn.Conv2d(256, 2, 1)
        nn.init.zeros_(self.flow_head.weight)
        nn.init.zeros_(self.flow_head.bias)  # type: ignore[arg-type]
        self.end = nn.Sequential(
            _conv(256, 256, 3, 2), _conv(256, 256), _conv(256, 512, 3, 2), nn.Flatten()
        )
        cells = (SIZE[0] // self.STRIDE) * (SIZE[1] // self.STRIDE)
        self.head = pose_head(512 * 3 * 3 + 2 * cells + 1, 4)

    def encode(self, first: Tensor, second: Tensor) -> tuple[Tensor, Tensor]:
        """Features (B, 4608) and flow (B, 2, 9, 12) in widths of images as for :meth:`forward`."""
        x = self.begin(torch.cat([first, second], dim=1))
        return self.end(x), self.flow_head(x)

    def regress(self, features: Tensor, flow: Tensor, focal: Tensor) -> PosePrediction:
        """Pose, its quaternion near that of no rotation: training starts from a valid one."""
        out = self.head(torch.cat([features, flow.flatten(1), focal], dim=1))
        return PosePrediction(out[:, :3], out[:, 3:] + out.new_tensor([1.0, 0.0, 0.0, 0.0]))

    def forward(self, first: Tensor, second: Tensor, focal: Tensor) -> PosePrediction:
        """Pose of images (B, 1, 144, 192) in -1..1 of a focal length (B, 1) over the width."""
        return self.regress(*self.encode(first, second), focal)


def pose_head(features: int, rotation: int) -> nn.Sequential:
    """Layers from features (B, features) to a translation and so many numbers of a rotation."""
    last = nn.Linear(512, 3 + rotation)
    nn.init.normal_(last.weight, std=0.01)
    nn.init.zeros_(last.bias)
    return nn.Sequential(nn.Linear(features, 512), nn.LeakyReLU(SLOPE), last)


def _conv(inputs: int, outputs: int, kernel: int = 3, stride: int = 1) -> nn.Sequential:
    return nn.Sequential(
        nn.Conv2d(inputs, outputs, kernel, stride, kernel // 2, bias=False),
        nn.BatchNorm2d(outputs),
        nn.LeakyReLU(SLOPE),
    )
