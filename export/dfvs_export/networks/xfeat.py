"""XFeat's encoder (Potje et al., CVPR 2024): keypoints and descriptors of a grey image."""

from typing import NamedTuple

import torch
from torch import Tensor, nn
from torch.nn import functional

CELL_PX = 8
"""Descriptors are computed on a grid of cells of this size; sizes are multiples of four cells."""

_NMS_PX = 5
"""Side of the window in which a keypoint has the highest score."""
_BORDER_PX = 9
"""Side of the window around a keypoint that lies inside the image."""
_LEAST_VARIANCE = 1e-5


class Keypoints(NamedTuple):
    """Keypoints (B, N, 2) px and their descriptors (B, N, 64)."""

    points: Tensor
    descriptors: Tensor


class ScoredKeypoints(NamedTuple):
    """Keypoints (B, N, 2) px, their descriptors (B, N, 64) and scores (B, N); 0 is no keypoint."""

    points: Tensor
    descriptors: Tensor
    scores: Tensor

    def found(self) -> Keypoints:
        """What is a keypoint of a single image (B = 1)."""
        is_found = self.scores[0] > 0
        return Keypoints(self.points[:, is_found], self.descriptors[:, is_found])


def _layer(inputs: int, outputs: int, kernel: int = 3, stride: int = 1) -> nn.Sequential:
    return nn.Sequential(
        nn.Conv2d(inputs, outputs, kernel, stride, kernel // 2, bias=False),
        nn.BatchNorm2d(outputs, affine=False),
        nn.ReLU(),
    )


class XFeat(nn.Module):
    """Encoder of grey images (B, 1, H, W), 0 to 255; a negative pixel is outside of the image.

    It gives the ``count`` keypoints of the highest scores.
    """

    def __init__(self, count: int) -> None:
        super().__init__()
        self.count = count
        self.skip1 = nn.Sequential(nn.AvgPool2d(4, 4), nn.Conv2d(1, 24, 1))
        self.block1 = nn.Sequential(
            _layer(1, 4), _layer(4, 8, stride=2), _layer(8, 8), _layer(8, 24, stride=2)
        )
        self.block2 = nn.Sequential(_layer(24, 24), _layer(24, 24))
        self.block3 = nn.Sequential(_layer(24, 64, stride=2), _layer(64, 64), _layer(64, 64, 1))
        self.block4 = nn.Sequential(_layer(64, 64, stride=2), _layer(64, 64), _layer(64, 64))
        self.block5 = nn.Sequential(
            _layer(64, 128, stride=2), _layer(128, 128), _layer(128, 128), _layer(128, 64, 1)
        )
        self.block_fusion = nn.Sequential(_layer(64, 64), _layer(64, 64), nn.Conv2d(64, 64, 1))
        self.heatmap_head = nn.Sequential(
            _layer(64, 64, 1), _layer(64, 64, 1), nn.Conv2d(64, 1, 1), nn.Sigmoid()
        )
        self.keypoint_head = nn.Sequential(
            _layer(64, 64, 1), _layer(64, 64, 1), _layer(64, 64, 1), nn.Conv2d(64, 65, 1)
        )

    def forward(self, image: Tensor) -> ScoredKeypoints:
        """Keypoints of images (B, 1, H, W); H and W are multiples of 32."""
        inside = (image >= 0).to(image.dtype)
        x = _normalised(image, inside)
        x2 = self.block2(self.block1(x) + self.skip1(x))
        x3 = self.block3(x2)
        x4 = self.block4(x3)
        x5 = self.block5(x4)
        size = (image.shape[2] // CELL_PX, image.shape[3] // CELL_PX)
        x4, x5 = (functional.interpolate(f, size, mode="bilinear") for f in (x4, x5))
        features = self.block_fusion(x3 + x4 + x5)
        logits = self.keypoint_head(functional.pixel_unshuffle(x, CELL_PX))
        return self._select(features, logits, inside)

    def _select(self, features: Tensor, logits: Tensor, inside: Tensor) -> ScoredKeypoints:
        """Keypoints of the highest scores, with descriptors sampled at them."""
        height, width = inside.shape[2:]
        likely = functional.pixel_shuffle(functional.softmax(logits, 1)[:, :64], CELL_PX)
        reliable = functional.interpolate(
            self.heatmap_head(features), scale_factor=CELL_PX, mode="bilinear"
        )
        peak = functional.max_pool2d(likely, _NMS_PX, 1, _NMS_PX // 2) == likely
        outside = functional.max_pool2d(1 - inside, _BORDER_PX, 1, _BORDER_PX // 2)
        score = likely * reliable * peak.to(likely.dtype) * (1 - outside)
        scores, index = score.flatten(1).topk(self.count, dim=1)
        row = torch.div(index, width, rounding_mode="floor")
        points = torch.stack([index - row * width, row], dim=-1).to(image_dtype := likely.dtype)
        scale = torch.tensor([2 / (width - 1), 2 / (height - 1)], dtype=image_dtype)
        sampled = functional.grid_sample(
            functional.normalize(features, dim=1),
            (points * scale.to(points.device) - 1)[:, None],
            mode="bicubic",
            align_corners=False,
        )
        descriptors = functional.normalize(sampled[:, :, 0].transpose(1, 2), dim=-1)
        return ScoredKeypoints(points, descriptors, scores)


def _normalised(image: Tensor, inside: Tensor) -> Tensor:
    """Image of zero mean and unit variance over its inside; 0 outside."""
    count = inside.sum((2, 3), keepdim=True).clamp(min=1)
    mean = (image * inside).sum((2, 3), keepdim=True) / count
    centred = (image - mean) * inside
    variance = (centred * centred).sum((2, 3), keepdim=True) / count
    return centred * torch.rsqrt(variance + _LEAST_VARIANCE)
