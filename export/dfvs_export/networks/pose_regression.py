"""Networks that regress the pose between two images, after two publications.

``StackedNet`` is after Saxena et al. (ICRA 2017): FlowNet's encoder (FlowNetSimple, Dosovitskiy et
al., 2015) on both images stacked, then translation and quaternion. ``SiameseNet`` is after Bateux
et al. (ICRA 2018): an encoder of ImageNet that both images go through, here EfficientNet-Lite0,
then translation and rotation vector from the features of both.

Three things are added. Flow on a coarse grid is predicted on the way, and learnt, which stands for
FlowNet's pretraining. The focal length goes in beside the features, for cameras of any. The second
network is told which features of both images are most alike (as in GMFlow, Xu et al., 2022).
"""

from collections.abc import Mapping
from typing import Literal, NamedTuple

import torch
from torch import Tensor, nn
from torch.nn import functional

from dfvs_export.networks.efficientnet import CHANNELS, EfficientNetLite0

SIZE = (192, 144)
"""Of both images, px (width, height)."""
STRIDE = 16
"""Of the grid that flow is predicted on, px."""

_SLOPE = 0.1


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
    head: nn.Sequential

    def encode(self, first: Tensor, second: Tensor) -> tuple[Tensor, Tensor]:
        """Features (B, N) and flow (B, 2, 9, 12) of images (B, 1, 144, 192) in -1..1."""
        raise NotImplementedError

    def regress(self, features: Tensor, flow: Tensor, focal: Tensor) -> PosePrediction:
        """Pose from what :meth:`encode` gives."""
        out = self.head(torch.cat([features, flow.flatten(1), focal], dim=1))
        return PosePrediction(out[:, :3], out[:, 3:])

    def forward(self, first: Tensor, second: Tensor, focal: Tensor) -> PosePrediction:
        """Pose of images (B, 1, 144, 192) in -1..1 of a focal length (B, 1) over the width."""
        return self.regress(*self.encode(first, second), focal)


class StackedNet(PoseNet):
    """FlowNet's encoder with half of its channels, and batch normalisation, on stacked images."""

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
        self.flow_head = _flow_head(256)
        self.end = nn.Sequential(
            _conv(256, 256, 3, 2), _conv(256, 256), _conv(256, 512, 3, 2), nn.Flatten()
        )
        self.head = _head(512 * 3 * 3, 4)

    def encode(self, first: Tensor, second: Tensor) -> tuple[Tensor, Tensor]:
        """Features and flow of both images stacked."""
        x = self.begin(torch.cat([first, second], dim=1))
        return self.end(x), self.flow_head(x)

    def regress(self, features: Tensor, flow: Tensor, focal: Tensor) -> PosePrediction:
        """Pose, its quaternion near that of no rotation: training starts from a valid one."""
        translation, rotation = super().regress(features, flow, focal)
        return PosePrediction(translation, rotation + rotation.new_tensor([1.0, 0.0, 0.0, 0.0]))


class SiameseNet(PoseNet):
    """EfficientNet-Lite0 to 1/16 on either image, convolutions on the features of both."""

    rotation = "vector"
    unit = "depth"

    def __init__(self) -> None:
        super().__init__()
        self.encoder = EfficientNetLite0(levels=4)
        self.begin = nn.Sequential(
            _conv(2 * CHANNELS[3] + 3, 192), _conv(192, 192), _conv(192, 192), _conv(192, 192)
        )
        self.sharpness = nn.Parameter(torch.tensor(3.0))
        self.flow_head = _flow_head(192)
        self.end = nn.Sequential(_conv(192, 192, 3, 2), _conv(192, 64, 1), nn.Flatten())
        self.head = _head(64 * 5 * 6, 3)

    def encode(self, first: Tensor, second: Tensor) -> tuple[Tensor, Tensor]:
        """Features and flow from the features of either image."""
        both = torch.cat([first, second]).expand(-1, 3, -1, -1)
        a, b = self.encoder(both)[3].chunk(2)
        matched = self._match(a, b)
        x = self.begin(torch.cat([a, b, matched], dim=1))
        return self.end(x), matched[:, :2] + self.flow_head(x)

    def _match(self, a: Tensor, b: Tensor) -> Tensor:
        """Mean flow to the features that are most alike, in widths, and how sure that is.

        Features are (B, C, 9, 12), the result is (B, 3, 9, 12).
        """
        rows, columns = a.shape[2:]
        x, y = (torch.arange(n, dtype=torch.float32) / columns for n in (columns, rows))
        grid = torch.stack([x.expand(rows, -1), y[:, None].expand(-1, columns)]).flatten(1)
        first, second = (functional.normalize(f.float().flatten(2), dim=1) for f in (a, b))
        alike = self.sharpness.exp() * (first.transpose(1, 2) @ second)
        share = alike.softmax(dim=2)
        flow = (share @ grid.T).transpose(1, 2) - grid
        matched = torch.cat([flow, share.amax(dim=2)[:, None]], dim=1)
        return matched.reshape(-1, 3, rows, columns)


NETWORKS: Mapping[str, type[PoseNet]] = {"saxena": StackedNet, "bateux": SiameseNet}
"""By the names of their first authors."""


def _conv(inputs: int, outputs: int, kernel: int = 3, stride: int = 1) -> nn.Sequential:
    return nn.Sequential(
        nn.Conv2d(inputs, outputs, kernel, stride, kernel // 2, bias=False),
        nn.BatchNorm2d(outputs),
        nn.LeakyReLU(_SLOPE),
    )


def _flow_head(features: int) -> nn.Conv2d:
    head = nn.Conv2d(features, 2, 1)
    nn.init.zeros_(head.weight)
    nn.init.zeros_(head.bias)  # type: ignore[arg-type]
    return head


def _head(features: int, rotation: int) -> nn.Sequential:
    """Layers on features, flow and focal length."""
    inputs = features + 2 * (SIZE[0] // STRIDE) * (SIZE[1] // STRIDE) + 1
    last = nn.Linear(512, 3 + rotation)
    nn.init.normal_(last.weight, std=0.01)
    nn.init.zeros_(last.bias)
    return nn.Sequential(nn.Linear(inputs, 512), nn.LeakyReLU(_SLOPE), last)
