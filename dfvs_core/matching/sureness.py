"""How much of a flow is sure, and the surer of two."""

from __future__ import annotations

import numpy as np

from dfvs_core.arrays import BoolArray
from dfvs_core.correspondence import FlowField

_SURE = 0.5


def sure_share(field: FlowField) -> float:
    """Share of the picture whose flow is more likely right than wrong."""
    return float(np.mean(field.confidence > _SURE))


def surer(first: FlowField, second: FlowField) -> FlowField:
    """Return the flow that more of the picture is sure of."""
    return max(first, second, key=sure_share)


def surer_of_each(first: FlowField, second: FlowField) -> FlowField:
    """Return the surer of two flows pixel by pixel."""
    better = second.confidence > first.confidence
    flow = np.where(better[..., None], second.flow, first.flow)
    return FlowField(flow, np.maximum(first.confidence, second.confidence))


def unsure(field: FlowField) -> FlowField:
    """Return a flow without any confidence in it."""
    return FlowField(field.flow, np.zeros_like(field.confidence))


def only(field: FlowField, where: BoolArray) -> FlowField:
    """Return a flow with confidence at these pixels (H, W) alone."""
    return FlowField(field.flow, field.confidence * where)


def nothing(size: tuple[int, int]) -> FlowField:
    """Flow of pictures (height, width) of which nothing is known."""
    return FlowField(np.zeros((*size, 2), np.float32), np.zeros(size, np.float32))
