"""Moving least squares: sure matches speak for plain walls, since rooms are made of planes."""

from __future__ import annotations

import torch
from torch import Tensor
from torch.nn import functional

_GLOBAL_RIDGE = 1e-3
_RIDGE = 0.02
"""Mean sureness in a window below which its correction is held back."""
_SLOPE_RIDGE = 4e-5
"""The same for slopes: 0.02 matches that spread over some 5 % of the image."""


def spread_affine(flow: Tensor, weight: Tensor, centres: Tensor) -> Tensor:
    """Moving least squares of affine flows, coarse to fine: sure cells speak for plain ones.

    First one robust affine motion for the whole image; then, over windows of 17, 9 and 5 cells,
    an affine correction of the coarser solution, held back by a ridge where little is sure.

    Parameters
    ----------
    flow : (N, 2, h, w)
        px.
    weight : (N, 1, h, w)
        Sureness, 0 to 1.
    centres : (1, 2, h, w)
        px.
    """
    scale = centres.amax()
    place = 2.0 * centres / scale - 1.0  # (1, 2, h, w) in [-1, 1]
    spread = torch.zeros_like(flow)
    robust = weight
    for width in (0.0, 0.25, 0.1):  # shares of the image
        if width > 0:
            robust = _robust(weight, flow - spread, width * scale)
        spread = _fit_globally(_moments(robust, flow, place).mean((2, 3), keepdim=True), place)
    for window, width in ((17, 0.1), (9, 0.06), (5, 0.04)):
        rest = flow - spread
        robust = _robust(weight, rest, width * scale)
        spread = spread + _fit_locally(_box(_moments(robust, rest, place), window), place)
    return spread


def _robust(weight: Tensor, rest: Tensor, width: Tensor) -> Tensor:
    """Geman and McClure's weights (N, 1, h, w) for residuals (N, 2, h, w) px."""
    error = (rest * rest).sum(1, keepdim=True)
    share = 1.0 / (1.0 + error / (width * width))
    return weight * share * share


def _moments(weight: Tensor, flow: Tensor, place: Tensor) -> Tensor:
    """Integrands (N, 12, h, w): w (1, x, y, xx, xy, yy), then w (u, v), w x (u, v), w y (u, v)."""
    x, y = place[:, :1], place[:, 1:]
    powers = torch.cat([torch.ones_like(x), x, y, x * x, x * y, y * y], 1)
    weighted = weight * flow
    return torch.cat([weight * powers, weighted, weighted * x, weighted * y], 1)


def _fit_globally(moments: Tensor, place: Tensor) -> Tensor:
    """Flow (N, 2, h, w) of the affine fit to moments (N, 12, 1, 1): 3 x 3 in closed form."""
    moments = moments / (moments[:, :1] + 1e-6)
    a, b, c, d, e, f = torch.split(moments[:, :6], 1, 1)
    a, d, f = a + _GLOBAL_RIDGE, d + _GLOBAL_RIDGE, f + _GLOBAL_RIDGE
    right, right_x, right_y = torch.split(moments[:, 6:], 2, 1)  # (N, 2, 1, 1) each
    cof_a, cof_b, cof_c = d * f - e * e, c * e - b * f, b * e - c * d
    cof_d, cof_e, cof_f = a * f - c * c, b * c - a * e, a * d - b * b
    determinant = a * cof_a + b * cof_b + c * cof_c
    middle = (cof_a * right + cof_b * right_x + cof_c * right_y) / determinant
    slope_x = (cof_b * right + cof_d * right_x + cof_e * right_y) / determinant
    slope_y = (cof_c * right + cof_e * right_x + cof_f * right_y) / determinant
    return middle + slope_x * place[:, :1] + slope_y * place[:, 1:]


def _box(x: Tensor, window: int) -> Tensor:
    """Mean over a square window, as two thin passes; outside counts as zero."""
    half = window // 2
    x = functional.avg_pool2d(x, (window, 1), 1, (half, 0))
    return functional.avg_pool2d(x, (1, window), 1, (0, half))


def _fit_locally(moments: Tensor, place: Tensor) -> Tensor:
    """Value (N, 2, h, w) at each cell of the ridge-held affine fit to its own moments."""
    m, mx, my, mxx, mxy, myy = torch.split(moments[:, :6], 1, 1)
    x, y = place[:, :1], place[:, 1:]
    # moments about the cell's own place
    cx, cy = mx - x * m, my - y * m
    cxx = mxx - x * (mx + cx) + _SLOPE_RIDGE
    cxy = mxy - x * my - y * cx
    cyy = myy - y * (my + cy) + _SLOPE_RIDGE
    right, right_x, right_y = torch.split(moments[:, 6:], 2, 1)  # (N, 2, h, w) each
    right_x, right_y = right_x - x * right, right_y - y * right
    determinant = cxx * cyy - cxy * cxy
    slope_x = (cx * cyy - cy * cxy) / determinant
    slope_y = (cy * cxx - cx * cxy) / determinant
    top = right - slope_x * right_x - slope_y * right_y
    bottom = m + _RIDGE - slope_x * cx - slope_y * cy
    return top / bottom.clamp(min=1e-4)
