"""Loss of dfvs-depth."""

from typing import NamedTuple

import torch
from torch import Tensor
from torch.nn import functional

from dfvs_export.networks.depth import Prediction

_SCALE_FREE = 0.85
"""Share of the mean error that the scale-invariant loss leaves out (Eigen et al., 2014)."""
_GRADIENT, _SSIM, _SIGMA, _NORMALS = 0.5, 0.3, 0.2, 0.2
_SCALES = 3
"""Sizes at which gradients are compared, each half of the one before."""
_SSIM_WINDOW = 7
_C1, _C2 = 0.01**2, 0.03**2


class Truth(NamedTuple):
    """Depth (B, H, W) m and unit normals (B, 3, H / 2, W / 2); 0 where unknown."""

    depth_m: Tensor
    normals: Tensor


def depth_loss(found: Prediction, truth: Truth) -> Tensor:
    """Loss of a prediction.

    Scale-invariant logarithmic error, gradients at several sizes (MiDaS, Ranftl et al., 2020),
    structural similarity of inverse depth (DenseDepth), the likelihood of a Laplace distribution
    for sigma, and the angle of normals.
    """
    log, log_sigma, normals = found
    known = truth.depth_m > 0
    true_log = -torch.where(known, truth.depth_m, 1.0).log()
    error = torch.where(known, log - true_log, 0.0)
    count = known.sum().clamp(min=1)
    mean = error.sum(dim=(1, 2)) / known.sum(dim=(1, 2)).clamp(min=1)
    square = (error**2).sum(dim=(1, 2)) / known.sum(dim=(1, 2)).clamp(min=1)
    scale_free = (square - _SCALE_FREE * mean**2).clamp(min=1e-6).sqrt().mean()
    spread = error.detach().abs() * 2.0**0.5 * (-log_sigma).exp() + log_sigma
    likelihood = torch.where(known, spread, 0.0).sum() / count
    similar = _ssim(torch.where(known, log, 0.0).exp(), torch.where(known, true_log, 0.0).exp())
    has_normal = truth.normals.abs().sum(dim=1) > 0
    angle = 1.0 - functional.cosine_similarity(normals.float(), truth.normals, dim=1)
    flat = torch.where(has_normal, angle, 0.0).sum() / has_normal.sum().clamp(min=1)
    return (
        scale_free
        + _GRADIENT * _gradient_error(error, known)
        + _SSIM * (1.0 - similar)
        + _SIGMA * likelihood
        + _NORMALS * flat
    )


def _gradient_error(error: Tensor, known: Tensor) -> Tensor:
    total = error.new_zeros(())
    for k in range(_SCALES):
        e, m = error[:, :: 2**k, :: 2**k], known[:, :: 2**k, :: 2**k]
        for axis in (1, 2):
            both = m.narrow(axis, 1, m.shape[axis] - 1) & m.narrow(axis, 0, m.shape[axis] - 1)
            step = e.diff(dim=axis).abs()
            total = total + torch.where(both, step, 0.0).sum() / both.sum().clamp(min=1)
    return total / _SCALES


def _ssim(x: Tensor, y: Tensor) -> Tensor:
    """Mean structural similarity of maps (B, H, W) whose range is about 1."""
    x, y = x.unsqueeze(1), y.unsqueeze(1)

    def mean(v: Tensor) -> Tensor:
        return functional.avg_pool2d(v, _SSIM_WINDOW, 1)

    mx, my = mean(x), mean(y)
    vx, vy, vxy = mean(x * x) - mx**2, mean(y * y) - my**2, mean(x * y) - mx * my
    top = (2 * mx * my + _C1) * (2 * vxy + _C2)
    return (top / ((mx**2 + my**2 + _C1) * (vx + vy + _C2))).mean()
