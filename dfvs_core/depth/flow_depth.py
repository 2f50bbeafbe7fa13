"""Depth from the size of the flow between two frames: the paper's scene-agnostic choice."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from dfvs_core.correspondence import DepthMap
from dfvs_core.depth.source import ConstantDepth, DepthInputs, DepthState, Memoryless


@dataclass(frozen=True, slots=True)
class FlowDepth(Memoryless):
    """``z = alpha / |flow(t, t-1)|`` (DFVS II-B.2), in normalised units, bounded.

    Flow caused by turning counts as if it came from moving, which is what makes it wrong for
    rotations; ``MotionDepth`` mends that. It is kept as the paper has it, for comparison.

    Parameters
    ----------
    alpha : float
        Scale, m: the depth at which the last step moved a point by one focal length.
    near_m, far_m : float
        Bounds; where there is no flow the far bound holds.
    fallback_m : float
        Depth while there is no earlier frame.
    """

    alpha: float = 0.03
    near_m: float = 0.5
    far_m: float = 10.0
    fallback_m: float = 3.0

    def estimate(
        self, inputs: DepthInputs, state: DepthState | None
    ) -> tuple[DepthMap, DepthState | None]:
        """Inverse flow length as depth."""
        if inputs.earlier is None:
            return ConstantDepth(self.fallback_m).estimate(inputs, state)
        length = np.linalg.norm(inputs.earlier.xy - inputs.xy, axis=2)
        z = np.clip(self.alpha / np.maximum(length, 1e-9), self.near_m, self.far_m)
        validity = np.where(length > 0, inputs.earlier.confidence, 0.0)
        return DepthMap(z.astype(np.float32), validity.astype(np.float32)), state
