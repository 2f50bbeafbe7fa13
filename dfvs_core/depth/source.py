"""The interface of all depth sources, and the two that need no pictures."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np

from dfvs_core.arrays import Float32Array, FloatArray
from dfvs_core.correspondence import DepthMap
from dfvs_core.errors import ConfigError


@dataclass(frozen=True, slots=True)
class EarlierView:
    """What an earlier frame says about the current grid.

    Parameters
    ----------
    xy : (h, w, 2) float64
        Normalised coordinates, in the earlier frame, of the current grid's points.
    confidence : (h, w) float64
        Trust in each correspondence, 0 to 1.
    T_earlier_current : (4, 4)
        Motion of the camera in between, from the vehicle's attitude and velocity, m.
    """

    xy: FloatArray
    confidence: FloatArray
    T_earlier_current: FloatArray


@dataclass(frozen=True, slots=True)
class DepthInputs:
    """What a depth source may use for one frame.

    Parameters
    ----------
    xy : (h, w, 2) float64
        Normalised coordinates of the grid in the current frame.
    earlier : EarlierView or None
        Correspondences with an earlier frame, where there is one.
    motion_m : (3,) float64
        How far the camera moved since the last frame, in the axes it had then, m.
    given : DepthMap or None
        Depth on the grid from a sensor, a renderer or a network.
    """

    xy: FloatArray
    earlier: EarlierView | None = None
    motion_m: tuple[float, float, float] = (0.0, 0.0, 0.0)
    given: DepthMap | None = None


@dataclass(frozen=True, slots=True)
class DepthState:
    """Memory of a depth source: inverse depth (h, w) in 1/m and its variance (h, w).

    Sources without memory keep it None.
    """

    rho: FloatArray
    variance: FloatArray


class DepthSource(Protocol):
    """Gives every grid point a depth; pure, its memory goes in and out."""

    def estimate(
        self, inputs: DepthInputs, state: DepthState | None
    ) -> tuple[DepthMap, DepthState | None]:
        """Depth on the grid, and the memory for the next frame."""
        ...

    def observe(
        self, xy: FloatArray, earlier: EarlierView, state: DepthState | None
    ) -> DepthState | None:
        """Memory after a comparison of the frame that was estimated last with an earlier one."""
        ...


class Memoryless:
    """A source that knows nothing from one frame to the next."""

    def observe(
        self, xy: FloatArray, earlier: EarlierView, state: DepthState | None
    ) -> DepthState | None:
        """Learn nothing."""
        return state


@dataclass(frozen=True, slots=True)
class GivenDepth(Memoryless):
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
class ConstantDepth(Memoryless):
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
        return DepthMap(_full(shape, self.z_m), _full(shape, 0.0)), state


def _full(shape: tuple[int, ...], value: float) -> Float32Array:
    return np.full(shape, value, dtype=np.float32)
