"""Interface of the depth sources; given and constant depth."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np

from dfvs_core.depth.depth_map import DepthMap
from dfvs_core.errors import ConfigError
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
class DepthInputs:
    """What a depth source may use for one frame.

    Parameters
    ----------
    xy : (h, w, 2) float64
        Normalised coordinates of the grid in the current frame.
    earlier : EarlierView or None
        Correspondences with an earlier frame, where there is one.
    link : GoalLink or None
        Where the grid is seen in the goal view, if that is known.
    given : DepthMap or None
        Depth on the grid from a sensor, a renderer or a network.
    """

    xy: FloatArray
    earlier: EarlierView | None = None
    link: GoalLink | None = None
    given: DepthMap | None = None


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


class DepthSource(Protocol):
    """Gives every grid point a depth; pure, its memory goes in and out."""

    def estimate(
        self, inputs: DepthInputs, state: DepthState | None
    ) -> tuple[DepthMap, DepthState | None]:
        """Depth on the grid, and the memory for the next frame."""
        ...


@dataclass(frozen=True, slots=True)
class GivenDepth:
    """Depth measured elsewhere: a sensor, the simulator's truth, a depth network."""

    def estimate(
        self, inputs: DepthInputs, state: DepthState | None
    ) -> tuple[DepthMap, DepthState | None]:
        """Pass on what was given.

        Raises
        ------
        ConfigError
            If nothing was given.
        """
        if inputs.given is None:
            raise ConfigError("depth source 'given' got no depth", "a depth map with every frame")
        return inputs.given, state


@dataclass(frozen=True, slots=True)
class ConstantDepth:
    """The same depth everywhere: crude, yet a sound last resort."""

    z_m: float = 3.0

    def __post_init__(self) -> None:
        """Refuse depths that are none."""
        if not (np.isfinite(self.z_m) and self.z_m > 0):
            raise ConfigError(f"constant depth {self.z_m} m", "a positive number")

    def estimate(
        self, inputs: DepthInputs, state: DepthState | None
    ) -> tuple[DepthMap, DepthState | None]:
        """Return the constant."""
        shape = inputs.xy.shape[:2]
        z_m = np.full(shape, self.z_m, dtype=np.float32)
        return DepthMap(z_m, np.zeros_like(z_m)), state
