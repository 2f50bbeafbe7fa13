"""Points of the servo law: grid of normalised correspondences with depth."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from dfvs_core.depth.depth_map import DepthMap
from dfvs_core.geometry.arrays import BoolArray, FloatArray
from dfvs_core.geometry.camera import CameraModel
from dfvs_core.matching.correspondence import FlowField

LEAST_POINTS = 24
"""Points by which a pose is estimated, or two structures are compared."""

GUESSED_SPREAD = 0.5
"""Relative standard deviation of inverse depth around a guess: a scene's own spread."""


@dataclass(frozen=True, slots=True)
class ServoPoints:
    """N correspondences in normalised coordinates.

    Parameters
    ----------
    xy, xy_goal : (N, 2) float64
        Where each point is seen now, and where the goal image shows it.
    z_m : (N,) float64
        Depth in the current view, m, positive.
    weight : (N,) float64
        How much each correspondence is trusted, 0 to 1.
    depth_spread : (N,) float64
        Relative standard deviation of inverse depth: 0 where it was measured exactly.
    """

    xy: FloatArray
    xy_goal: FloatArray
    z_m: FloatArray
    weight: FloatArray
    depth_spread: FloatArray

    @property
    def error(self) -> FloatArray:
        """Feature error e = s - s* (N, 2): minus the flow, in normalised units."""
        return self.xy - self.xy_goal

    def select(self, keep: BoolArray) -> ServoPoints:
        """Return the points for which keep : (N,) is true."""
        return ServoPoints(
            self.xy[keep],
            self.xy_goal[keep],
            self.z_m[keep],
            self.weight[keep],
            self.depth_spread[keep],
        )


@dataclass(frozen=True, slots=True)
class GridSamples:
    """Flow and confidence read on a regular grid of pixels.

    ``pixels`` (h, w, 2) are pixel centres, ``flow`` (h, w, 2) px, ``confidence`` (h, w).
    """

    pixels: FloatArray
    flow: FloatArray
    confidence: FloatArray


def sample_grid(field: FlowField, stride: int) -> GridSamples:
    """Flow at every stride-th pixel; confidence is the least one in its neighbourhood of 3 x 3.

    A single pixel on the edge of an object may belong to either side, so it only counts when its
    neighbours are confident as well.
    """
    height, width = field.confidence.shape
    offset = stride // 2
    rows, columns = slice(offset, height, stride), slice(offset, width, stride)
    u = np.arange(width, dtype=np.float64)[columns] + 0.5
    v = np.arange(height, dtype=np.float64)[rows] + 0.5
    padded = np.pad(field.confidence, 1, mode="edge")
    windows = np.lib.stride_tricks.sliding_window_view(padded, (3, 3))
    return GridSamples(
        pixels=np.stack(np.meshgrid(u, v), axis=-1),
        flow=field.flow[rows, columns].astype(np.float64),
        confidence=windows[rows, columns].min(axis=(2, 3)).astype(np.float64),
    )


def without_cells(field: FlowField, cells: BoolArray, stride: int) -> FlowField:
    """Flow (H, W) without confidence around those points (h, w) of the grid."""
    height, width = field.confidence.shape
    around = np.repeat(np.repeat(cells, stride, axis=0), stride, axis=1)
    around = np.pad(around, ((0, stride), (0, stride)))[:height, :width]
    return FlowField(field.flow, np.where(around, np.float32(0.0), field.confidence))


def points_from_flow(
    samples: GridSamples, depth: DepthMap, camera: CameraModel, goal_camera: CameraModel
) -> ServoPoints:
    """Turn grid samples with their depth (h, w) into normalised correspondences.

    Points whose partner lies outside the goal image get no weight.
    """
    unconfident = 1.0 - np.clip(depth.validity.reshape(-1).astype(np.float64), 0.0, 1.0)
    pixels = samples.pixels.reshape(-1, 2)
    partners = pixels + samples.flow.reshape(-1, 2)
    inside = ((partners >= 0) & (partners <= [goal_camera.width, goal_camera.height])).all(axis=1)
    return ServoPoints(
        xy=camera.normalise(pixels),
        xy_goal=goal_camera.normalise(partners),
        z_m=depth.z_m.reshape(-1).astype(np.float64),
        weight=np.where(inside, samples.confidence.reshape(-1), 0.0),
        depth_spread=GUESSED_SPREAD * np.sqrt(unconfident),
    )
