"""Depth of an image, and structure of a goal view, from a depth network.

The depth of the goal image is estimated once, before the flight to it: it depends on the image, its
intrinsics and the network alone, so a replay computes it again bit for bit.
"""

from dataclasses import dataclass
from typing import Literal, Protocol

import numpy as np

from dfvs_core.depth.source import UNKNOWN_VARIANCE, DepthState
from dfvs_core.errors import ImageError
from dfvs_core.geometry.arrays import Float32Array, FloatArray, ImageArray
from dfvs_core.geometry.camera import CameraModel

DepthUnit = Literal["m", "1/m", "relative", "affine"]
"""Of a network's output: metric depth or inverse depth; either up to a factor; or inverse depth up
to a factor and an offset."""

_AFFINE_RANGE = 6.0
"""Farthest over nearest depth that is assumed where the offset of inverse depth is unknown."""
_AFFINE_PERCENTILES = (2.0, 98.0)
_AFFINE_SPREAD = 0.5
"""Relative standard deviation of inverse depth under that assumption: a scene's own spread."""
_LEAST_SPREAD = 0.02
"""Relative standard deviation that no network's structure undercuts."""
_SCALE_UNKNOWN = 0.6
"""Standard deviation of the logarithm of a scale that is not told."""


@dataclass(frozen=True, slots=True)
class NetworkDepth:
    """Depth of an image by a network.

    Parameters
    ----------
    rho : (H, W) float32
        Inverse depth along the optical axis, 1/m, or as ``unit`` says; not positive or not finite
        where nothing is known (of an affine one: not finite).
    spread : (H, W) float32
        Standard deviation of its logarithm, that of the whole image's scale included.
    unit : str
        See ``DepthUnit``.
    scale_spread : float or None
        Standard deviation of the logarithm of the whole image's scale; None unless it is metric.
    """

    rho: Float32Array
    spread: Float32Array
    unit: DepthUnit
    scale_spread: float | None

    def __post_init__(self) -> None:
        """Check shapes."""
        if self.rho.ndim != 2 or self.spread.shape != self.rho.shape:
            raise ImageError(
                f"inverse depth of shape {self.rho.shape} with spread of {self.spread.shape}",
                "two arrays of (H, W)",
            )


class DepthEstimator(Protocol):
    """Gives the depth of an image; the same arguments give the same bits."""

    def estimate(self, image: ImageArray, camera: CameraModel) -> NetworkDepth:
        """Depth (H, W) of an image (H, W, 3) uint8 RGB that this camera took."""
        ...


@dataclass(frozen=True, slots=True)
class GoalDepth:
    """Structure of the goal view before the flight.

    ``structure`` is inverse depth and its variance on the goal view's grid, in units whose length
    is 1 m to within ``scale_spread``, the standard deviation of its logarithm.
    """

    structure: DepthState
    scale_spread: float


def goal_depth(found: NetworkDepth, stride: int, prior: float) -> GoalDepth:
    """Structure of a goal view from its depth by a network.

    Parameters
    ----------
    found : NetworkDepth
        Of the goal image at the working size.
    stride : int
        Grid step, px.
    prior : float
        Median depth in units where the network's is not metric.
    """
    rows, columns = (_cell_centres(n, stride) for n in found.rho.shape)
    grid = np.ix_(rows, columns)
    rho, spread = found.rho[grid].astype(np.float64), found.spread[grid].astype(np.float64)
    if found.unit == "affine":
        rho, spread = _without_offset(rho), np.maximum(spread, _AFFINE_SPREAD)
    known = np.isfinite(rho) & (rho > 0.0) & np.isfinite(spread)
    scale_spread = found.scale_spread
    if scale_spread is None:
        scale_spread = _SCALE_UNKNOWN
        rho = rho / (prior * float(np.median(rho[known]))) if known.any() else rho
    else:
        spread = np.sqrt(np.maximum(spread**2 - scale_spread**2, 0.0))
    variance = (np.maximum(spread, _LEAST_SPREAD) * rho) ** 2
    structure = DepthState(
        np.where(known, rho, 1.0 / prior), np.where(known, variance, UNKNOWN_VARIANCE)
    )
    return GoalDepth(structure, scale_spread)


def _cell_centres(size_px: int, stride: int) -> FloatArray:
    """Index of the middle pixel of every cell along one axis; of the last one, inside the image."""
    centres = np.arange(stride // 2, size_px + stride // 2, stride)
    return np.minimum(centres, size_px - 1)


def _without_offset(rho: FloatArray) -> FloatArray:
    """Inverse depth (h, w), up to a factor, from one that has an unknown offset as well."""
    finite = np.isfinite(rho)
    if not finite.any():
        return rho
    far, near = np.percentile(rho[finite], _AFFINE_PERCENTILES)
    share = (rho - far) / max(float(near - far), 1e-9)
    least = 1.0 / _AFFINE_RANGE
    return np.asarray(np.clip(least + (1.0 - least) * share, 0.5 * least, 2.0), np.float64)
