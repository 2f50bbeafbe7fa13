"""A network that works on smaller pictures than it is given: resizing inside its graphs."""

from __future__ import annotations

import math
from dataclasses import dataclass

import torch
from torch import Tensor, nn
from torch.nn import functional

from dfvs_core.errors import ConfigError

_WIDER_SIDE_PX = {"fp32": 256, "fp16": 256, "int8": 224}
"""By precision. The refined flow of five rooms was best at 256; 192 is faster, 320 no better. Who
asks for 8 bits asks for speed, and much of the time is in operators that 8 bits do not help."""
_MULTIPLE = 16
_LEAST_PX = 64
_LEVELS = 255.0


def default_working_size(size: tuple[int, int], precision: str = "fp32") -> tuple[int, int]:
    """Working size for pictures of ``size`` (both width, height), whose wider side is 256 px or so.

    In int8 it is 224 px.
    """
    share = min(1.0, _WIDER_SIDE_PX[precision] / max(size))
    return _near(size[0], share), _near(size[1], share)


def _near(side: int, share: float) -> int:
    wanted = max(_LEAST_PX, _MULTIPLE * round(side * share / _MULTIPLE))
    return min(side, wanted)


@dataclass(frozen=True, slots=True)
class Sizes:
    """Sizes (width, height) px of a bundle's pictures, and of those that its network works on."""

    picture: tuple[int, int]
    working: tuple[int, int]

    def __post_init__(self) -> None:
        """Refuse to enlarge pictures.

        Raises
        ------
        ConfigError
            If the working size is not within the pictures' own.
        """
        if any(w > p for w, p in zip(self.working, self.picture, strict=True)):
            raise ConfigError(
                f"working size {self.working[0]}x{self.working[1]}",
                f"{self.picture[0]}x{self.picture[1]} or less, the size of the pictures",
            )

    @property
    def differ(self) -> bool:
        """Whether anything has to be resized."""
        return self.picture != self.working


class Shrink(nn.Module):
    """Area mean of 8-bit pictures (1, C, H, W) in [0, 1] at the working size; exact.

    Width and height become any fraction of themselves: blocks of n rows, then of n columns,
    become m. Pictures and weights are whole numbers in it, which every runtime adds up alike, in
    whatever order.
    """

    rows: Tensor
    columns: Tensor

    def __init__(self, sizes: Sizes) -> None:
        super().__init__()
        columns, rows = (_overlaps(p, w) for p, w in zip(sizes.picture, sizes.working, strict=True))
        self.size = (sizes.working[1], sizes.working[0])
        self.register_buffer("rows", rows, persistent=False)
        self.register_buffer("columns", columns.T, persistent=False)

    def forward(self, image: Tensor) -> Tensor:
        """Return the pictures (1, C, h, w)."""
        channels, width = image.shape[1], image.shape[3]
        levels = (image * _LEVELS).round()
        less = self.rows @ levels.reshape(-1, self.rows.shape[1], width)  # a block of rows each
        sums = less.reshape(-1, self.columns.shape[0]) @ self.columns
        parts = self.rows.shape[1] * self.columns.shape[0]
        return sums.reshape(1, channels, *self.size) * (1.0 / (_LEVELS * parts))


def _overlaps(full: int, less: int) -> Tensor:
    """Whole numbers (m, n): how far each of m cells overlaps each of n that fill the same length.

    ``m / n`` is ``less / full`` as a fraction in its lowest terms; every row's sum is n.
    """
    common = math.gcd(full, less)
    m, n = less // common, full // common
    start, end = torch.arange(m) * n, (torch.arange(m) + 1) * n
    left, right = torch.arange(n) * m, (torch.arange(n) + 1) * m
    overlap = torch.minimum(end[:, None], right) - torch.maximum(start[:, None], left)
    return overlap.clamp(min=0).to(torch.float32)


def enlarged_flow(flow: Tensor, sizes: Sizes) -> Tensor:
    """Flow (1, 2, H, W) in px of the pictures from one (1, 2, h, w) in px of the working size."""
    (width, height), (w, h) = sizes.picture, sizes.working
    factors = torch.tensor([width / w, height / h], dtype=flow.dtype).reshape(1, 2, 1, 1)
    scaled = flow * factors
    return functional.interpolate(scaled, (height, width), mode="bilinear", align_corners=False)
