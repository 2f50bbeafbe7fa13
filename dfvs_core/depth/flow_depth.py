"""Depth from the magnitude of the flow between two frames (the paper's choice)."""

from dataclasses import dataclass

import numpy as np

from dfvs_core.depth.depth_map import DepthMap
from dfvs_core.depth.source import DepthState, EarlierView, constant_depth
from dfvs_core.geometry.arrays import Float32Array, FloatArray
from dfvs_core.geometry.camera import homogeneous

_LEAST_FORWARD = 0.1
_MEMORY = 0.5
"""Share of the logarithm of the depth of the frame before."""
_TRUST = 0.5
"""Validity where the flow is confident: one alpha for every speed makes the depth a rough guess."""


@dataclass(frozen=True, slots=True)
class FlowDepth:
    """``z = alpha / |flow(t, t-1)|`` (DFVS II-B.2), in normalised units, bounded.

    Two deviations from the paper. The flow that turning alone causes is taken out first, since it
    says nothing of depth; the rotation is known from the attitude. Otherwise whatever turns seems
    near. And the geometric mean is taken with the depth of the frame before: a fast step makes all
    seem near, which makes the next step slow, which makes all seem far; without a memory the speed
    swings from frame to frame and nothing damps that. With half of the logarithm remembered the
    swing is gone after one frame, whatever the speed. Flow that is no longer than its noise says
    nothing, and what is remembered holds: near the goal all would seem far, and the gain rise.

    Parameters
    ----------
    alpha : float
        Scale, m: the depth at which the last step moved a point by one focal length.
    near_m, far_m : float
        Bounds; where there is no flow the far bound holds.
    fallback_m : float
        Depth while there is no earlier frame.
    noise : float
        Length of flow that says nothing, in normalised units.
    """

    alpha: float = 0.03
    near_m: float = 0.5
    far_m: float = 10.0
    fallback_m: float = 3.0
    noise: float = 0.0

    def estimate(
        self, xy: FloatArray, earlier: EarlierView | None, state: DepthState | None
    ) -> tuple[DepthMap, DepthState]:
        """Inverse flow length as depth of the grid ``xy`` (h, w, 2), and that as memory."""
        if earlier is None:
            depth = constant_depth(xy.shape[:2], self.fallback_m)
            return depth, state or _remembered(depth.z_m)
        unmoved = _turned(xy, earlier.T_earlier_current[:3, :3])
        length = np.linalg.norm(earlier.xy - unmoved, axis=2)
        z = np.clip(self.alpha / np.maximum(length, 1e-9), self.near_m, self.far_m)
        if state is not None:
            memory = np.where(length > self.noise, _MEMORY, 1.0)
            z = z ** (1.0 - memory) * state.rho**-memory
        validity = np.where(length > 0, _TRUST * earlier.confidence, 0.0)
        return DepthMap(z.astype(np.float32), validity.astype(np.float32)), _remembered(z)


def _remembered(z_m: FloatArray | Float32Array) -> DepthState:
    rho = 1.0 / np.asarray(z_m, dtype=np.float64)
    return DepthState(rho, np.zeros_like(rho))


def _turned(xy: FloatArray, R: FloatArray) -> FloatArray:
    """Where points xy (h, w, 2) would be seen if the camera had turned by R (3, 3) alone."""
    rays = homogeneous(xy) @ R.T
    turned: FloatArray = rays[..., :2] / np.maximum(rays[..., 2:], _LEAST_FORWARD)
    return turned
