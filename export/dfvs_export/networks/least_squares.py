"""Moving least squares: sure matches speak for plain walls, since rooms are made of planes."""

from __future__ import annotations

import torch
from torch import Tensor

_GLOBAL_RIDGE = 1e-3
_RIDGE = 0.02
"""Mean sureness in a window below which its correction is held back."""
_SLOPE_RIDGE = 4e-5
"""The same for slopes: 0.02 matches that spread over some 5 % of the image."""
_LEAST = 1e-4

# Moments of a window stand in the order 1, x, x2, y, xy, (x2 y), y2, ...: x quickest.
_ONE, _X, _XX, _Y, _XY, _YY = 0, 1, 2, 3, 4, 6
_ORDERS = 9


def spread_affine(flow: Tensor, weight: Tensor, centres: Tensor) -> Tensor:
    """Moving least squares of affine flows, coarse to fine: sure cells speak for plain ones.

    First one robust affine motion for the whole image; then, over windows of 17, 9 and 5 cells,
    an affine correction of the coarser solution, held back by a ridge where little is sure.

    Cells are small and steps are many here: what costs time is how many operators there are, not
    how much each does. So all moments are taken by one product, and all fits solved at once.

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
    root = 1.0 + error * (1.0 / (width * width))
    return weight / (root * root)


def _fit_globally(weight: Tensor, flow: Tensor, place: Tensor) -> Tensor:
    """Flow (N, 2, h, w) of one affine fit; moments are taken about the weighted middle."""
    n, _, h, w = flow.shape
    share = (weight / (weight.sum((2, 3), keepdim=True) + 1e-3)).reshape(n, 1, h * w)
    both = torch.cat([place.expand(n, 2, h, w), flow], 1).reshape(n, 4, h * w)
    mean = both @ share.transpose(1, 2)  # (N, 4, 1)
    away = both - mean
    second = (away[:, :2] * share) @ away.transpose(1, 2)  # (N, 2, 4): place by place and flow
    unit = torch.eye(2, device=flow.device, dtype=flow.dtype)
    ridge = torch.cat([_GLOBAL_RIDGE * unit, torch.zeros_like(unit)], 1)
    system = second + ridge
    matrix = system[:, :, :2]
    adjugate = (matrix * unit).sum((1, 2), keepdim=True) * unit - matrix  # of a symmetric 2 x 2
    solved = adjugate @ system  # determinant on the left's diagonal, slopes times it on the right
    slopes = solved[:, :, 2:] / solved[:, :1, :1]
    fitted = mean[:, 2:] + slopes.transpose(1, 2) @ away[:, :2]
    return fitted.reshape(n, 2, h, w)


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

    The fit's value at the cell itself is a quotient of determinants (Cramer's rule): of the
    moments of the values and of those of the weights, by the same cofactors.

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
    columns = _window_moments(w, window, step)  # (3 w, w)
    values = torch.cat([weight, weight * flow], 1)  # (N, 3, h, w)
    across = columns @ values.transpose(2, 3)  # (N, 3, 3 w, h)
    moments = (rows @ across.transpose(2, 3)).reshape(n, 3, 3, h, 3, w)
    moments = moments.permute(0, 2, 4, 1, 3, 5).reshape(n, _ORDERS, 3, h * w) + _ridges(step)
    m = moments[:, :, 0]  # (N, 9, h w), of the weights
    cofactors = (
        m[:, [_XX, _Y, _X]] * m[:, [_YY, _XY, _XY]] - m[:, [_XY, _X, _Y]] * m[:, [_XY, _YY, _XX]]
    )
    determinants = (cofactors.unsqueeze(2) * moments[:, [_ONE, _X, _Y]]).sum(1)  # (N, 3, h w)
    bottom = torch.maximum(determinants[:, :1], _LEAST * cofactors[:, :1])
    return (determinants[:, 1:] / bottom).reshape(n, 2, h, w)


def _ridges(like: Tensor) -> Tensor:
    """What is added (9, 3, 1) to the moments of weights and values."""
    of_weights = {_ONE: _RIDGE, _XX: _SLOPE_RIDGE, _YY: _SLOPE_RIDGE}
    rows = [[of_weights.get(order, 0.0), 0.0, 0.0] for order in range(_ORDERS)]
    return torch.tensor(rows, device=like.device).unsqueeze(2)
