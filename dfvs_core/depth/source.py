"""Exchange types of the depth sources, and constant depth."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from dfvs_core.depth.depth_map import DepthMap
from dfvs_core.geometry.arrays import FloatArray, IntArray

UNKNOWN_VARIANCE = 1e6
"""Variance of an inverse depth of which nothing is known."""


@dataclass(frozen=True, slots=True)
class EarlierView:
    """Measurement of the current grid by an earlier frame.

    Parameters
    ----------
    xy : (h, w, 2) float64
        Normalised coordinates, in the earlier frame, of the current grid's points.
    confidence : (h, w) float64
        Trust in each correspondence, 0 to 1.
    T_earlier_current : (4, 4)
        Motion of the camera in between, in units of the relative depth.
    rotation_spread_rad : float
        Standard deviation of its rotation.
    """

    xy: FloatArray
    confidence: FloatArray
    T_earlier_current: FloatArray
    rotation_spread_rad: float = 0.0


@dataclass(frozen=True, slots=True)
class GoalLink:
    """Where the current grid is seen in the goal view.

    Parameters
    ----------
    cell : (h, w) int
        Cell of the goal view's grid, row by row; -1 where a point is not matched.
    xy_goal : (h, w, 2) float64
        Normalised coordinates in the goal view.
    T_current_goal : (4, 4)
        Pose of the goal camera in the current one, in units of the relative depth.
    grid_shape : tuple of int
        Rows and columns of the goal view's grid.
    """

    cell: IntArray
    xy_goal: FloatArray
    T_current_goal: FloatArray
    grid_shape: tuple[int, int]


@dataclass(frozen=True, slots=True)
class DepthState:
    """Memory of a depth source: inverse depth (h, w) and its variance (h, w).

    Of depth from motion it is that of the goal view's grid, in units; of others it is that of the
    current grid, in m. Sources without memory keep it None.
    """

    rho: FloatArray
    variance: FloatArray

    def scaled(self, factor: float) -> DepthState:
        """The same with all depths times a factor."""
        return DepthState(self.rho / factor, self.variance / factor**2)


def constant_depth(shape: tuple[int, ...], z_m: float) -> DepthMap:
    """The same depth everywhere: crude, yet a sound last resort."""
    depth_m = np.full(shape, z_m, dtype=np.float32)
    return DepthMap(depth_m, np.zeros_like(depth_m))
