"""What the networks that regress poses are trained by: errors of pose and of flow."""

from typing import NamedTuple

import numpy as np
import torch
from torch import Tensor
from torch.nn import functional

from dfvs_export.networks.pose_regression import Flow, PosePrediction
from dfvs_export.networks.siamese_pose import RADIUS, UPDATES, SiameseNet
from dfvs_export.networks.stacked_pose import StackedNet
from dfvs_export.training.descent import bfloat16_where_quick
from dfvs_export.training.drawn_flows import drawn_flows, with_errors

_MATCH_WEIGHT, _LOCAL_WEIGHT = 0.2, 0.15
_FLOW_WEIGHTS = (0.1, 0.15, 0.3)
"""Of flow from coarse to fine: at first and after each refinement, or at each level."""
_LEAST_MOTION = 0.03
"""Errors of pose count in shares of the motion, depths and rad together, and this."""
_DRAWN_FLOWS = 64
"""Per step."""
_SPREAD = (-8.0, 0.5)


class PoseBatch(NamedTuple):
    """Tensors of some pairs; ``translation`` is in depths, ``rotation`` a vector in rad.

    ``flow`` (B, 2, 36, 48) is in widths, not a number where it is unknown.
    """

    first: Tensor
    second: Tensor
    focal: Tensor
    translation: Tensor
    rotation: Tensor
    flow: Tensor


class PoseErrors(NamedTuple):
    """Mean errors of translation in depths, of rotation, of flow in widths."""

    translation: float
    rotation_rad: float
    flow: float


def stacked_loss(
    network: StackedNet, batch: PoseBatch, rng: np.random.Generator
) -> tuple[Tensor, PoseErrors]:
    """Errors of pose in shares of the motion, and of flow by its likelihood at every level.

    The pose is also learnt from the true flows with drawn errors.
    """
    with bfloat16_where_quick():
        levels = network.flows(batch.first, batch.second)
    total = torch.zeros(())
    for found, weight in zip(levels, _FLOW_WEIGHTS, strict=True):
        true = functional.avg_pool2d(batch.flow, batch.flow.shape[3] // found.flow.shape[3])
        total = total + weight * _flow_loss(found, true)
    pose = network.regress(levels[-1].halved(), batch.focal)
    pose_loss, t_error, r_error = _pose_loss(pose, batch.translation, batch.rotation)
    drawn = network.regress(with_errors(functional.avg_pool2d(batch.flow, 2), rng), batch.focal)
    total = total + pose_loss + _pose_loss(drawn, batch.translation, batch.rotation)[0]
    return total, PoseErrors(t_error, r_error, _flow_error(levels[-1], batch.flow))


def siamese_loss(
    network: SiameseNet, batch: PoseBatch, rng: np.random.Generator
) -> tuple[Tensor, PoseErrors]:
    """Errors of pose in shares of the motion, of flow by its likelihood, and of what is alike.

    The pose is also learnt from drawn flows, which cost next to nothing.
    """
    with bfloat16_where_quick():
        coarse, fine = network.describe(batch.first, batch.second)
    half = functional.avg_pool2d(batch.flow, 2)
    similarity = network.similarity(coarse)
    found = network.first_flow(coarse, similarity)
    total = _MATCH_WEIGHT * _match_loss(similarity, half)
    total = total + _FLOW_WEIGHTS[0] * _flow_loss(found, half)
    found = found.doubled()
    for _, weight in zip(range(UPDATES), _FLOW_WEIGHTS[1:], strict=True):
        before = found.flow.detach()
        with bfloat16_where_quick():
            found, alike = network.refined(fine, found)
        total = total + _LOCAL_WEIGHT * _local_loss(alike, batch.flow - before)
        total = total + weight * _flow_loss(found, batch.flow)
    pose = network.regress(found.halved(), batch.focal)
    pose_loss, t_error, r_error = _pose_loss(pose, batch.translation, batch.rotation)
    drawn, focal, truth = drawn_flows(_DRAWN_FLOWS, rng)
    total = total + pose_loss + _pose_loss(network.regress(drawn, focal), *truth)[0]
    return total, PoseErrors(t_error, r_error, _flow_error(found, batch.flow))


def _pose_loss(
    found: PosePrediction, translation: Tensor, rotation: Tensor
) -> tuple[Tensor, float, float]:
    """Loss, and mean errors of translation and of rotation vector."""
    t, r = (torch.linalg.vector_norm(x, dim=1) for x in (translation, rotation))
    t_error = torch.linalg.vector_norm(found.translation - translation, dim=1)
    r_error = torch.linalg.vector_norm(found.rotation - rotation, dim=1)
    loss = ((t_error + r_error) / (_LEAST_MOTION + t + r)).mean()
    return loss, t_error.mean().item(), r_error.mean().item()


def _flow_error(found: Flow, true: Tensor) -> float:
    return _mean_where(~true.isnan(), (found.flow - true.nan_to_num()).abs()).item()


def _flow_loss(found: Flow, true: Tensor) -> Tensor:
    """Negative logarithm of the likelihood of flow by Laplace distributions."""
    spread = found.spread.clamp(*_SPREAD)
    apart = (found.flow - true.nan_to_num()).abs()
    return _mean_where(~true.isnan(), apart * (-spread).exp() + spread)


def _match_loss(similarity: Tensor, flow: Tensor) -> Tensor:
    """Negative log probability of the cells that flow leads to, (B, 432, 432), in both ways."""
    rows, columns = flow.shape[2:]
    y, x = torch.meshgrid(torch.arange(rows), torch.arange(columns), indexing="ij")
    to = torch.stack([x, y]) + flow * columns
    log = 0.5 * (similarity.log_softmax(2) + similarity.log_softmax(1))
    return _interpolated_loss(
        log.transpose(1, 2).reshape(len(log), -1, rows, columns), to, (rows, columns)
    )


def _local_loss(similarity: Tensor, change: Tensor) -> Tensor:
    """Negative log probability (B, 49, h, w) of the steps by which flow was off."""
    to = change * change.shape[3] + RADIUS
    size = 2 * RADIUS + 1
    reached = ((to > 0) & (to < size - 1)).all(1, keepdim=True)
    return _interpolated_loss(
        similarity.float().log_softmax(1), to.where(reached, np.nan), (size, size)
    )


def _interpolated_loss(log: Tensor, to: Tensor, size: tuple[int, int]) -> Tensor:
    """Mean of -log (B, rows * columns, h, w) at places (B, 2, h, w) between four candidates."""
    rows, columns = size
    known = ~to.isnan().any(1)
    x, y = to.nan_to_num().unbind(1)
    x, y = x.clamp(0, columns - 1.001), y.clamp(0, rows - 1.001)
    left, top = x.floor(), y.floor()
    loss = torch.zeros_like(x)
    for right, below in ((0, 0), (1, 0), (0, 1), (1, 1)):
        share = (1 - (x - left - right).abs()) * (1 - (y - top - below).abs())
        index = ((top + below) * columns + left + right).long()
        loss = loss - share * log.gather(1, index[:, None])[:, 0]
    return _mean_where(known, loss)


def _mean_where(known: Tensor, values: Tensor) -> Tensor:
    return torch.where(known, values, 0.0).sum() / known.sum().clamp(min=1)
