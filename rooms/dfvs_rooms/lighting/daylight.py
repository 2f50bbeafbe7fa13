"""Light of the sun and the open sky on a place without a roof, with shadow maps from afar."""

import math
from dataclasses import dataclass

import numpy as np

from dfvs_core.geometry.arrays import BoolArray, FloatArray
from dfvs_core.geometry.camera import CameraModel
from dfvs_core.geometry.poses import make_pose
from dfvs_rooms.generator.room import Sky
from dfvs_sim.render.renderer import Renderer
from dfvs_sim.scene.frames import ned_from_room

_SUN_POINTS, _SUN_SPREAD = 4, 0.012
_SKY_POINTS = 64
_SUN_MAP_PX, _SKY_MAP_PX = 1024, 256
_DISTANCES_AWAY = 60.0
_GOLDEN_ANGLE = math.pi * (3.0 - math.sqrt(5.0))
_LEAST_SLOPE = 0.15


@dataclass(frozen=True, slots=True, eq=False)
class _Beam:
    """Parallel light: where it comes from (3,), NED, and its irradiance (3,) head on."""

    towards: FloatArray
    irradiance: FloatArray
    map_px: int


def sky_irradiance(
    sky: Sky, points: FloatArray, normals: FloatArray, blockers: Renderer, rng: np.random.Generator
) -> FloatArray:
    """Irradiance (N, 3) of sun and sky at points (N, 3) with unit normals (N, 3), NED.

    The sun is a few beams side by side; the sky, even all over, is beams from all over it.
    """
    low, high = points.min(axis=0), points.max(axis=0)
    centre, radius_m = 0.5 * (low + high), 0.52 * float(np.linalg.norm(high - low))
    total = np.zeros_like(points)
    for beam in _sun_beams(sky, rng) + _sky_beams(sky, rng):
        slope = normals @ beam.towards
        lit = np.flatnonzero(slope > 0)
        free = _reached(beam, points[lit] - centre, slope[lit], (blockers, centre, radius_m))
        lit = lit[free]
        total[lit] += slope[lit, None] * beam.irradiance
    return total


def _sun_beams(sky: Sky, rng: np.random.Generator) -> list[_Beam]:
    beams = []
    for _ in range(_SUN_POINTS):
        towards = sky.to_sun + _SUN_SPREAD * rng.normal(size=3)
        towards /= np.linalg.norm(towards)
        share = np.array(sky.sun_irradiance) / _SUN_POINTS
        beams.append(_Beam(ned_from_room(towards), share, _SUN_MAP_PX))
    return beams


def _sky_beams(sky: Sky, rng: np.random.Generator) -> list[_Beam]:
    """Directions spread evenly over the upper half by the golden angle."""
    share = np.array(sky.radiance) * 2 * math.pi / _SKY_POINTS
    first = rng.uniform(0, 2 * math.pi)
    beams = []
    for k in range(_SKY_POINTS):
        up, turn = (k + 0.5) / _SKY_POINTS, first + k * _GOLDEN_ANGLE
        level = math.sqrt(1.0 - up * up)
        towards = np.array([level * math.cos(turn), level * math.sin(turn), up])
        beams.append(_Beam(ned_from_room(towards), share, _SKY_MAP_PX))
    return beams


def _reached(
    beam: _Beam, offsets: FloatArray, slope: FloatArray, scene: tuple[Renderer, FloatArray, float]
) -> BoolArray:
    """Tell which points, at offsets (N, 3) from the scene's centre, a beam reaches."""
    blockers, centre, radius_m = scene
    away_m = _DISTANCES_AWAY * radius_m
    fov = 2 * math.atan(1.02 / _DISTANCES_AWAY)
    camera = CameraModel.from_horizontal_fov(beam.map_px, beam.map_px, fov)
    helper = np.eye(3)[int(np.abs(beam.towards).argmin())]
    x = np.cross(beam.towards, helper)
    x /= np.linalg.norm(x)
    R = np.stack([x, np.cross(-beam.towards, x), -beam.towards], axis=1)
    depth = blockers.depth(camera, make_pose(R, centre + away_m * beam.towards))
    seen = (offsets - away_m * beam.towards) @ R
    i, j = camera.project(seen).T.astype(np.intp).clip(0, beam.map_px - 1)
    steep = np.sqrt(1 - np.minimum(slope, 1.0) ** 2) / np.maximum(slope, _LEAST_SLOPE)
    slack = 0.012 + 2.04 * radius_m / beam.map_px * (0.5 + steep)
    blocker = depth[j, i]
    return np.asarray((blocker == 0.0) | (seen[:, 2] - slack <= blocker), np.bool_)
