"""Height of a flight's start above the scene's floor: the simulated ground is flat."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from dfvs_core.geometry.arrays import FloatArray
from dfvs_core.geometry.camera import CameraModel
from dfvs_core.geometry.poses import make_pose
from dfvs_sim.ground.pilot import LEAST_HEIGHT_M, MOST_HEIGHT_M, USUAL_HEIGHT_M
from dfvs_sim.render.renderer import Renderer

_DOWNWARDS: FloatArray = np.eye(3)
"""Rotation world from camera of a view straight down: the optical axis is NED's down."""
_PROBE = CameraModel.from_horizontal_fov(64, 64, math.radians(120.0))
_LEAST_SEEN = 0.05
"""Share of the downward view that must show something."""
_LOWEST_PERCENT = 95.0
"""Percentile of the surfaces below that is the floor: furniture is above it, stray points below."""


@dataclass(frozen=True, slots=True)
class TakeOff:
    """How far to climb, and what the user has to know of it; empty where nothing."""

    height_m: float
    remark: str = ""


def floor_below(renderer: Renderer, point: FloatArray) -> float | None:
    """Level (down, m) of the floor below a point (3,) in NED; None where nothing is below it."""
    depth = renderer.depth(_PROBE, make_pose(_DOWNWARDS, point))
    seen = depth[depth > 0]
    if seen.size < _LEAST_SEEN * depth.size:
        return None
    return float(point[2]) + float(np.percentile(seen, _LOWEST_PERCENT))


def take_off_from_floor(renderer: Renderer, points: Sequence[FloatArray]) -> TakeOff:
    """Climb to the first point from the lowest floor below any of them.

    The ground of a simulated vehicle is flat: where floors differ it is the lowest one, so that
    the vehicle does not touch it on its way.

    Parameters
    ----------
    renderer : Renderer
        Of the scene.
    points : sequence of (3,)
        Start and goals of the body, NED, m.
    """
    floors = [level for p in points if (level := floor_below(renderer, p)) is not None]
    if not floors:
        return TakeOff(
            USUAL_HEIGHT_M,
            f"the scene has no floor under the start: the ground is put {USUAL_HEIGHT_M:g} m below",
        )
    height_m = max(floors) - float(points[0][2])
    if LEAST_HEIGHT_M <= height_m <= MOST_HEIGHT_M:
        return TakeOff(height_m)
    bounded_m = min(max(height_m, LEAST_HEIGHT_M), MOST_HEIGHT_M)
    return TakeOff(
        bounded_m,
        f"the start is {height_m:.2f} m above the scene's floor: the ground is put "
        f"{bounded_m:g} m below",
    )
