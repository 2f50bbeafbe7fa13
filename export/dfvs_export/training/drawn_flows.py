"""Flows with drawn errors, also of drawn motions before a plane: what a pose is regressed from."""

import numpy as np
import torch
from torch import Tensor
from torch.nn import functional

from dfvs_core.geometry.arrays import FloatArray
from dfvs_core.geometry.poses import so3_log
from dfvs_export.networks.pose_regression import SIZE, STRIDE, Flow
from dfvs_export.training.planar_pairs import PlanarMotion

_SPREAD_PX = (0.1, 3.0)
_WRONG, _WRONG_PX = 0.45, (3.0, 40.0)
"""Share of cells whose flow is wrong, at most, and its spread there."""
_STILL, _FAST = (0.1, 0.03), 0.05
"""Errors shrink with the mean flow, in widths, to such a share of them; for wrong and other."""
_UNEVEN = 0.6
"""Deviation of the logarithm of the spread over a view."""
_MISJUDGED = 0.3
"""Deviation of the logarithm of the spread that is told."""
_TOGETHER, _APART = 0.7, 0.5
"""Errors that neighbours share, and that they do not, in their spread."""


def drawn_flows(count: int, rng: np.random.Generator) -> tuple[Flow, Tensor, tuple[Tensor, Tensor]]:
    """Flows (count, 2, 18, 24), focal lengths (count, 1), translations and rotation vectors."""
    motions = [PlanarMotion.drawn(rng) for _ in range(count)]
    true = stacked([_flow(motion).transpose(2, 0, 1) for motion in motions])
    poses = [motion.in_depths() for motion in motions]
    focal = stacked([np.array([motion.focal]) for motion in motions])
    translation, rotation = ([T[:3, 3] for T in poses], [so3_log(T[:3, :3]) for T in poses])
    return with_errors(true, rng), focal, (stacked(translation), stacked(rotation))


def with_errors(true: Tensor, rng: np.random.Generator) -> Flow:
    """Flows (count, 2, 18, 24) with drawn errors; where they are not a number all is wrong."""
    count, size = len(true), true.shape[2:]

    def smooth() -> Tensor:
        coarse = torch.from_numpy(rng.normal(size=(count, 1, 5, 6)).astype(np.float32))
        return functional.interpolate(coarse, size=tuple(size), mode="bicubic")

    def level(span_px: tuple[float, float]) -> Tensor:
        low, high = np.log(span_px)
        return stacked(list(rng.uniform(low, high, (count, 1, 1, 1))))

    unknown = true.isnan().any(1, keepdim=True)
    true = true.nan_to_num()
    mean = true.abs().mean((1, 2, 3), keepdim=True).clamp(max=_FAST) / _FAST
    spread = level(_SPREAD_PX) + _UNEVEN * smooth() + mean.clamp(min=_STILL[1]).log()
    blobs = smooth()
    right = [1.0 - rng.uniform(0.0, _WRONG) for _ in range(count)]
    bounds = [blob.quantile(share) for blob, share in zip(blobs, right, strict=True)]
    wrong = level(_WRONG_PX) + mean.clamp(min=_STILL[0]).log()
    is_wrong = (blobs > torch.stack(bounds).reshape(-1, 1, 1, 1)) | unknown
    spread = torch.where(is_wrong, torch.maximum(spread, wrong), spread) - float(np.log(SIZE[0]))
    apart = torch.from_numpy(rng.normal(size=true.shape).astype(np.float32))
    noise = _TOGETHER * torch.cat([smooth(), smooth()], 1) + _APART * apart
    judged = torch.from_numpy(rng.normal(size=spread.shape).astype(np.float32))
    return Flow(true + spread.exp() * noise, spread + _MISJUDGED * judged)


def _flow(motion: PlanarMotion) -> FloatArray:
    """True flow (18, 24, 2) in widths, also to outside of the second view."""
    return (motion.seen(STRIDE) - motion.camera.grid(STRIDE)) / motion.camera.width


def stacked(rows: list[FloatArray]) -> Tensor:
    """Arrays of one shape as a tensor (B, ...) float32."""
    return torch.from_numpy(np.stack(rows).astype(np.float32))
