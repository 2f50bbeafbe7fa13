"""Moving least squares: sure matches speak for plain walls, since rooms are made of planes."""

from __future__ import annotations

import torch
from torch import Tensor

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
        spread = _fit_globally(robust, flow, place)
    step = place[0, 0, 0, 1] - place[0, 0, 0, 0]
    for window, width in ((17, 0.1), (9, 0.06), (5, 0.04)):
        rest = flow - spread
        robust = _robust(weight, rest, width * scale)
        spread = spread + _fit_locally(robust, rest, window, step)
    return spread


def _robust(weight: Tensor, rest: Tensor, width: Tensor) -> Tensor:
    """Geman and McClure's weights (N, 1, h, w) for residuals (N, 2, h, w) px."""
    error = (rest * rest).sum(1, keepdim=True)
    share = 1.0 / (1.0 + error / (width * width))
    return weight * share * share


def _fit_globally(weight: Tensor, flow: Tensor, place: Tensor) -> Tensor:
    """Flow (N, 2, h, w) of one affine fit; moments are taken about the weighted middle."""
    share = weight / (weight.sum((2, 3), keepdim=True) + 1e-3)
    middle = (share * place).sum((2, 3), keepdim=True)  # (N, 2, 1, 1)
    mean = (share * flow).sum((2, 3), keepdim=True)
    away = place - middle
    x, y = away[:, :1], away[:, 1:]
    xx, xy, yy = ((share * p).sum((2, 3), keepdim=True) for p in (x * x, x * y, y * y))
    xx, yy = xx + _GLOBAL_RIDGE, yy + _GLOBAL_RIDGE
    rest = share * (flow - mean)
    right_x, right_y = ((rest * p).sum((2, 3), keepdim=True) for p in (x, y))
    determinant = xx * yy - xy * xy
    slope_x = (yy * right_x - xy * right_y) / determinant
    slope_y = (xx * right_y - xy * right_x) / determinant
    return mean + slope_x * x + slope_y * y


def _window_moments(cells: int, window: int, step: Tensor) -> Tensor:
    """Matrix (3 cells, cells) that takes a row of cells to moments over a window about each.

    Those of order 0, 1 and 2 about the cell's own place, divided by the window's width; outside
    counts as zero. Taken about the cell itself they lose nothing to rounding, which moments about
    the image's middle do.
    """
    index = torch.arange(cells, device=step.device, dtype=torch.float32)
    away = index - index.unsqueeze(1)  # (to, from)
    inside = (away.abs() <= window // 2).float() / window
    offset = away * step
    return torch.cat([inside, inside * offset, inside * offset * offset])


def _fit_locally(weight: Tensor, flow: Tensor, window: int, step: Tensor) -> Tensor:
    """Value (N, 2, h, w) at each cell of the ridge-held affine fit over a square window.

    Parameters
    ----------
    weight : (N, 1, h, w)
        0 to 1.
    flow : (N, 2, h, w)
        px.
    window : int
        Width in cells.
    step : scalar
        Distance of neighbouring cells.
    """
    n, _, h, w = flow.shape
    rows = _window_moments(h, window, step)  # (3 h, h)
    columns = _window_moments(w, window, step).T  # (w, 3 w)
    moments = rows @ torch.cat([weight, weight * flow], 1) @ columns  # (N, 3, 3 h, 3 w)
    moments = moments.reshape(n, 3, 3, h, 3, w)

    def moment(x: int, y: int, of: slice) -> Tensor:
        return moments[:, of, y, :, x]

    ones, values = slice(0, 1), slice(1, 3)
    m, cx, cy = moment(0, 0, ones), moment(1, 0, ones), moment(0, 1, ones)
    cxx, cxy = moment(2, 0, ones) + _SLOPE_RIDGE, moment(1, 1, ones)
    cyy = moment(0, 2, ones) + _SLOPE_RIDGE
    right, right_x, right_y = moment(0, 0, values), moment(1, 0, values), moment(0, 1, values)
    determinant = cxx * cyy - cxy * cxy
    slope_x = (cx * cyy - cy * cxy) / determinant
    slope_y = (cy * cxx - cx * cxy) / determinant
    top = right - slope_x * right_x - slope_y * right_y
    bottom = m + _RIDGE - slope_x * cx - slope_y * cy
    return top / bottom.clamp(min=1e-4)
