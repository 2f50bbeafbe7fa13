"""What cameras and radio links do to a picture: light, colour, blur, noise, JPEG, glare."""

from __future__ import annotations

from collections.abc import Callable

import torch
from torch import Tensor
from torch.nn import functional


def _draw(shape: tuple[int, ...], low: float, high: float, like: Tensor) -> Tensor:
    return low + (high - low) * torch.rand(shape, device=like.device)


def _sometimes(images: Tensor, share: float, change: Callable[[Tensor], Tensor]) -> Tensor:
    """Change a random share of the images."""
    chosen = torch.nonzero(torch.rand(len(images), device=images.device) < share).squeeze(1)
    if len(chosen) == 0:
        return images
    return images.index_copy(0, chosen, change(images[chosen]))


def disturb(images: Tensor) -> Tensor:
    """Disturb every image (N, 3, H, W) in [0, 1] in its own way.

    Uses torch's global random state; seed that for repeatable results.
    """
    images = _exposure(images)
    images = _sometimes(images, 0.35, _blur)
    images = _sometimes(images, 0.12, _glare)
    images = _sometimes(images, 0.7, _noise)
    return _sometimes(images, 0.35, _jpeg).clamp(0.0, 1.0)


def _noise(images: Tensor) -> Tensor:
    sigma = _draw((len(images), 1, 1, 1), 0.0, 1.0, images) ** 2 * 0.06
    return (images + sigma * torch.randn_like(images)).clamp(0.0, 1.0)


def _exposure(images: Tensor) -> Tensor:
    """Gain, white balance, gamma and offset."""
    n = len(images)
    gain = torch.exp(_draw((n, 1, 1, 1), -0.7, 0.45, images))
    white = torch.exp(_draw((n, 3, 1, 1), -0.12, 0.12, images))
    gamma = torch.exp(_draw((n, 1, 1, 1), -0.35, 0.35, images))
    offset = _draw((n, 1, 1, 1), -0.04, 0.06, images)
    return ((images * gain * white).clamp(1e-4, 1.0) ** gamma + offset).clamp(0.0, 1.0)


def _blur(images: Tensor) -> Tensor:
    """Motion or focus blur: a random line or a small square, one 7 x 7 kernel per image."""
    n = len(images)
    axis = torch.arange(-3, 4, device=images.device, dtype=images.dtype)
    y, x = torch.meshgrid(axis, axis, indexing="ij")
    angle = _draw((n, 1, 1), 0.0, 3.1416, images)
    length = _draw((n, 1, 1), 0.4, 3.0, images)
    width = torch.where(_draw((n, 1, 1), 0, 1, images) < 0.5, length * 0.6, 0.4)
    along = x * torch.cos(angle) + y * torch.sin(angle)
    across = y * torch.cos(angle) - x * torch.sin(angle)
    kernel = torch.exp(-0.5 * (along / length) ** 2 - 0.5 * (across / width) ** 2)
    kernel = (kernel / kernel.sum((1, 2), keepdim=True)).repeat_interleave(3, 0).unsqueeze(1)
    flat = functional.pad(
        images.reshape(1, n * 3, *images.shape[2:]), (3, 3, 3, 3), mode="replicate"
    )
    return functional.conv2d(flat, kernel, groups=n * 3).reshape(images.shape)


def _glare(images: Tensor) -> Tensor:
    """A bright spot somewhere, over one view alone."""
    n, _, h, w = images.shape
    y = torch.arange(h, device=images.device).reshape(1, 1, h, 1) / w
    x = torch.arange(w, device=images.device).reshape(1, 1, 1, w) / w
    cx, cy = _draw((n, 1, 1, 1), 0, 1, images), _draw((n, 1, 1, 1), 0, h / w, images)
    radius = _draw((n, 1, 1, 1), 0.03, 0.25, images)
    spot = torch.exp(-((x - cx) ** 2 + (y - cy) ** 2) / radius**2)
    return images + spot * _draw((n, 1, 1, 1), 0.2, 1.2, images)


def _dct_basis(like: Tensor) -> Tensor:
    """Orthonormal DCT-II matrix (8, 8)."""
    k = torch.arange(8, device=like.device, dtype=like.dtype)
    basis = torch.cos((2 * k + 1).unsqueeze(0) * k.unsqueeze(1) * torch.pi / 16) / 2
    basis[0] /= 2**0.5
    return basis


def _jpeg(images: Tensor) -> Tensor:
    """Damage by coarse quantisation of the cosine transform of 8 x 8 blocks."""
    n, c, h, w = images.shape
    basis = _dct_basis(images)
    full = functional.pad(images, (0, -w % 8, 0, -h % 8), mode="replicate")
    blocks = full.unfold(2, 8, 8).unfold(3, 8, 8)  # (N, 3, rows, columns, 8, 8)
    spectrum = basis @ (blocks - 0.5) @ basis.T
    k = torch.arange(8, device=images.device, dtype=images.dtype)
    step = (1.0 + k.unsqueeze(0) + k.unsqueeze(1)) * _draw((n, 1, 1, 1, 1, 1), 0.004, 0.05, images)
    damaged = basis.T @ (torch.round(spectrum / step) * step) @ basis + 0.5
    whole = damaged.permute(0, 1, 2, 4, 3, 5).reshape(n, c, full.shape[2], full.shape[3])
    return whole[..., :h, :w]
