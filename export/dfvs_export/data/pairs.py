"""Pairs of views of one room, with exact flow both ways and what both views see."""

from __future__ import annotations

import math
from dataclasses import dataclass

import torch
from torch import Tensor

from dfvs_core.pair_files import FARTHEST_DEPTH_M, LARGEST_REACH, MEDIUM_SHARE, SMALL_SHARE
from dfvs_export.data.render import Picture, View, render
from dfvs_export.data.scenes import Scene, make_scene
from dfvs_export.data.textures import TextureBank

_WORLD_FORWARD_CAMERA = torch.tensor([[0.0, 0.0, 1.0], [-1.0, 0.0, 0.0], [0.0, -1.0, 0.0]])
"""Rotation of a camera that looks along world x, its y down (world z is up)."""
_MAX_TRIES = 60


@dataclass(frozen=True, slots=True)
class PairSettings:
    """What to draw; how far views are moved, :func:`_motion` says.

    Parameters
    ----------
    width, height : int
        Image size, px.
    least_overlap : float
        Pairs with a smaller share of pixels seen in both are drawn anew.
    """

    width: int = 192
    height: int = 144
    least_overlap: float = 0.12


@dataclass(frozen=True, slots=True)
class Pair:
    """Two pictures (H, W, 3) float32, flows (H, W, 2) px and covisibility (H, W) both ways.

    A flow is exact wherever its covisibility is true; elsewhere it is the motion of the hidden
    point, or 0 where that lies behind the other camera (``solid`` false).
    """

    image_a: Tensor
    image_b: Tensor
    flow_ab: Tensor
    flow_ba: Tensor
    visible_a: Tensor
    visible_b: Tensor
    solid_a: Tensor
    solid_b: Tensor


def make_pair(bank: TextureBank, settings: PairSettings, g: torch.Generator) -> Pair:
    """Draw rooms and motions until one pair overlaps enough."""
    while True:
        scene = make_scene(bank.count, g)
        half_angle = 0.5 * math.radians(_uniform(g, 58.0, 92.0))
        focal = 0.5 * settings.width / math.tan(half_angle)
        for _ in range(4):
            pair = _try_pair(scene, bank, settings, focal, g)
            if pair is not None:
                return pair


def _try_pair(
    scene: Scene, bank: TextureBank, settings: PairSettings, focal: float, g: torch.Generator
) -> Pair | None:
    centre = _free_place(scene, g)
    if centre is None:
        return None
    first = View(_look(scene, centre, g), centre, focal, settings.width, settings.height)
    picture = render(scene, bank, first)
    if float(picture.inverse_depth.median()) > 1.0 / 0.35:
        return None
    second = _moved(scene, first, picture, g)
    if second is None:
        return None
    other = render(scene, bank, second)
    flow_ab, visible_a, solid_a = flow_between(first, picture, second, other)
    if float(visible_a.float().mean()) < settings.least_overlap:
        return None
    flow_ba, visible_b, solid_b = flow_between(second, other, first, picture)
    gain = _exposure_gain(picture.image, g)
    images = gain * picture.image, gain * other.image
    return Pair(*images, flow_ab, flow_ba, visible_a, visible_b, solid_a, solid_b)


def flow_between(
    a: View, seen_a: Picture, b: View, seen_b: Picture
) -> tuple[Tensor, Tensor, Tensor]:
    """Flow (H, W, 2) px from a to b, covisibility (H, W) and whether the flow means anything.

    A point is seen in both when one of the four pixels around its projection in b shows the
    same surface.
    """
    rays = a.rays()
    iz = seen_a.inverse_depth.reshape(-1, 1)
    # X / z, so that far points lose no precision
    moved = (rays @ a.R_world_camera.T + iz * (a.centre_m - b.centre_m)) @ b.R_world_camera
    ahead = (moved[:, 2] > 0.05) & (iz[:, 0] > 0)
    half = torch.tensor([0.5 * b.width, 0.5 * b.height])
    target = b.focal_px * moved[:, :2] / moved[:, 2:].clamp(min=0.05) + half
    source = a.focal_px * rays[:, :2] + half
    flow = torch.where(ahead.unsqueeze(1), target - source, 0.0)
    size = torch.tensor([b.width, b.height])
    inside = ahead & ((target >= 0) & (target <= size)).all(1)
    corner = (target - 0.5).floor().long()
    own = seen_a.surface.reshape(-1)
    same = torch.zeros_like(inside)
    for dx, dy in ((0, 0), (1, 0), (0, 1), (1, 1)):
        x = (corner[:, 0] + dx).clamp(0, b.width - 1)
        y = (corner[:, 1] + dy).clamp(0, b.height - 1)
        same |= seen_b.surface[y, x] == own
    shape = (a.height, a.width)
    visible = (inside & same).reshape(shape)
    return flow.reshape(*shape, 2), visible, ahead.reshape(shape)


def _exposure_gain(image: Tensor, g: torch.Generator) -> float:
    """Gain that a camera would choose: its brightest tenth lands between 0.3 and 1."""
    bright = float(torch.quantile(image.flatten(), 0.9))
    return _uniform(g, 0.3, 1.0) / max(bright, 0.02)


def _uniform(g: torch.Generator, low: float, high: float) -> float:
    return low + (high - low) * float(torch.rand((), generator=g))


def _free_place(scene: Scene, g: torch.Generator) -> Tensor | None:
    """Return a point outside of every box, 0.4 m or more from the room's faces."""
    for _ in range(_MAX_TRIES):
        place = 0.4 + torch.rand(3, generator=g) * (scene.size - 0.8)
        if not scene.solids.hold(place, 0.2):
            return place
    return None


def _look(scene: Scene, centre: Tensor, g: torch.Generator) -> Tensor:
    """World from camera (3, 3): mostly level, and mostly towards the room's middle."""
    yaw = _uniform(g, -math.pi, math.pi)
    if _uniform(g, 0, 1) < 0.7:
        x, y, _ = (0.5 * scene.size - centre).tolist()
        yaw = math.atan2(y, x) + 0.25 * yaw
    spread = 0.5 if _uniform(g, 0, 1) < 0.2 else 0.15
    pitch, roll = (spread * torch.randn(2, generator=g)).clamp(-1.0, 1.0).tolist()
    heading = rotation(torch.tensor([0.0, 0.0, yaw]))
    return heading @ _WORLD_FORWARD_CAMERA @ rotation(torch.tensor([pitch, 0.0, roll]))


def rotation(vector: Tensor) -> Tensor:
    """Rotation (3, 3) by a rotation vector (3,) rad."""
    x, y, z = vector.tolist()
    skew = torch.tensor([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]], dtype=torch.float64)
    R: Tensor = torch.linalg.matrix_exp(skew)
    return R.to(torch.float32)


def _moved(scene: Scene, view: View, picture: Picture, g: torch.Generator) -> View | None:
    """Move a view, within the room and outside of every box."""
    depth = 1.0 / max(float(picture.inverse_depth.median()), 0.05)
    for _ in range(_MAX_TRIES):
        reach, angles = _motion(depth, g)
        way = torch.nn.functional.normalize(torch.randn(3, generator=g), dim=0)
        centre = view.centre_m + reach * way
        margin = torch.minimum(centre, scene.size - centre).min()
        if float(margin) > 0.15 and not scene.solids.hold(centre, 0.12):
            R = view.R_world_camera @ rotation(angles)
            return View(R, centre, view.focal_px, view.width, view.height)
    return None


def _motion(depth_m: float, g: torch.Generator) -> tuple[float, Tensor]:
    """Distance, m, and camera rotation vector (3,) rad of one motion.

    Small ones are log-uniform, up to 0.25 m and 8 degrees; medium ones reach 0.5 m and 15 degrees;
    large ones a share of the median depth and 35, 35 and 55 degrees (``dfvs_core.pair_files``).
    """
    kind = _uniform(g, 0, 1)
    turn = 2 * torch.rand(3, generator=g) - 1
    if kind < SMALL_SHARE:
        reach = math.exp(_uniform(g, math.log(0.004), math.log(0.25)))
        return reach, turn * math.radians(math.exp(_uniform(g, math.log(0.2), math.log(8.0))))
    if kind < SMALL_SHARE + MEDIUM_SHARE:
        return _uniform(g, 0.0, 0.5), turn * math.radians(15.0)
    limits = torch.tensor([35.0, 35.0, 55.0]) * (math.pi / 180.0)
    return _uniform(g, 0.0, LARGEST_REACH) * min(depth_m, FARTHEST_DEPTH_M), turn * limits
