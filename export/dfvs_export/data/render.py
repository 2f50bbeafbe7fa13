"""Ray casting of a quadrilateral soup: colour, inverse depth and what is seen where.

With a quadrilateral's edges and corner as the columns of M (camera frame), a ray r with
``r_z = 1`` meets its plane at ``M^-1 r = (s / z, t / z, 1 / z)``: all three are linear in the
pixel, so a whole view is one matrix product and a comparison.
"""

from __future__ import annotations

from dataclasses import dataclass

import torch
from torch import Tensor

from dfvs_export.data.scenes import Lights, Quads, Scene
from dfvs_export.data.textures import TextureBank

_NEAR_M = 0.02
_NOTHING = -1


@dataclass(frozen=True, slots=True)
class View:
    """A pinhole's pose and size: world from camera R (3, 3), centre (3,) m, focal length px.

    The camera is optical (x right, y down, z forward); the principal point is the image's centre
    and pixel centres lie at +0.5.
    """

    R_world_camera: Tensor
    centre_m: Tensor
    focal_px: float
    width: int
    height: int

    def rays(self) -> Tensor:
        """Rays (H * W, 3) in the camera frame with z = 1."""
        device = self.centre_m.device
        x = (torch.arange(self.width, device=device) + 0.5 - 0.5 * self.width) / self.focal_px
        y = (torch.arange(self.height, device=device) + 0.5 - 0.5 * self.height) / self.focal_px
        gy, gx = torch.meshgrid(y, x, indexing="ij")
        return torch.stack([gx, gy, torch.ones_like(gx)], dim=-1).reshape(-1, 3)


@dataclass(frozen=True, slots=True)
class Picture:
    """What a view sees.

    Parameters
    ----------
    image : (H, W, 3) float32
        Linear colour, about [0, 1].
    inverse_depth : (H, W) float32
        1 / m, 0 where nothing is.
    surface : (H, W) int64
        Index of the quadrilateral seen, -1 for none.
    """

    image: Tensor
    inverse_depth: Tensor
    surface: Tensor


def render(scene: Scene, bank: TextureBank, view: View) -> Picture:
    """Cast one ray per pixel."""
    index = _visible_quads(scene.quads, view)
    quads = scene.quads.select(index)
    rays = view.rays()
    best, iz, st = _nearest_hits(quads, view, rays)
    hit = iz > 0
    z = 1.0 / iz.clamp(min=1e-3)
    points = view.centre_m + (rays * z.unsqueeze(1)) @ view.R_world_camera.T
    albedo = _albedo(quads, bank, view, (best, st, z), rays)
    colour = _shade(quads, scene.lights, view, (best, points), albedo)
    shape = (view.height, view.width)
    surface = torch.where(hit, index[best], _NOTHING)
    colour = torch.where(hit.unsqueeze(1), colour, 0.0)
    return Picture(colour.reshape(*shape, 3), iz.reshape(shape), surface.reshape(shape))


def _visible_quads(quads: Quads, view: View) -> Tensor:
    """Indices of what faces the camera and is not wholly outside one side of its frustum."""
    normal = torch.linalg.cross(quads.edge_u, quads.edge_v)
    facing = ((view.centre_m - quads.origin) * normal).sum(1) > 0
    u, v = quads.edge_u, quads.edge_v
    corners = torch.stack([quads.origin + a for a in (0 * u, u, v, u + v)], 1) - view.centre_m
    x, y, z = (corners @ view.R_world_camera).unbind(-1)  # (Q, 4) each
    tx, ty = 0.5 * view.width / view.focal_px, 0.5 * view.height / view.focal_px
    sides = torch.stack([z - _NEAR_M, tx * z - x, tx * z + x, ty * z - y, ty * z + y])
    inside = ~(sides < 0).all(dim=2).any(dim=0)
    return torch.nonzero((facing | quads.two_sided) & inside).squeeze(1)


def _nearest_hits(quads: Quads, view: View, rays: Tensor) -> tuple[Tensor, Tensor, Tensor]:
    """Nearest quadrilateral (P,), inverse depth (P,) and (s, t) (P, 2) of every ray."""
    R = view.R_world_camera
    corner = (quads.origin - view.centre_m) @ R
    M = torch.stack([quads.edge_u @ R, quads.edge_v @ R, corner], dim=2)  # (Q, 3, 3) columns
    inverse = torch.linalg.inv(M.double()).to(rays.dtype)
    s, t, iz = (inverse.transpose(0, 1) @ rays.T).unbind(0)  # (Q, P) each
    inside = torch.minimum(torch.minimum(s, t), iz - torch.maximum(s, t)) >= 0
    score = torch.where(inside & (iz < 1.0 / _NEAR_M), iz, torch.zeros_like(iz))
    best_iz, best = score.max(dim=0)
    pick = best.unsqueeze(0)
    safe = best_iz.clamp(min=1e-3)
    st = torch.stack([s.gather(0, pick)[0] / safe, t.gather(0, pick)[0] / safe], 1)
    return best, best_iz, st


def _albedo(
    quads: Quads,
    bank: TextureBank,
    view: View,
    hits: tuple[Tensor, Tensor, Tensor],
    rays: Tensor,
) -> Tensor:
    """Base colour (P, 3), filtered by the texels that a pixel covers."""
    best, st, z = hits
    extent = torch.stack([quads.edge_u.norm(dim=1), quads.edge_v.norm(dim=1)], 1)
    texels = extent * quads.texels_per_m.unsqueeze(1)
    normal = torch.nn.functional.normalize(torch.linalg.cross(quads.edge_u, quads.edge_v), dim=1)
    facing = ((rays @ view.R_world_camera.T) * normal[best]).sum(1).abs() / rays.norm(dim=1)
    footprint = quads.texels_per_m[best] * z / view.focal_px / facing.clamp(min=0.08).sqrt()
    uv = st * texels[best] + quads.uv_offset[best]
    return bank.sample(quads.texture[best], uv, torch.log2(footprint.clamp(min=1e-3)).clamp(min=0))


def _shade(
    quads: Quads, lights: Lights, view: View, hits: tuple[Tensor, Tensor], albedo: Tensor
) -> Tensor:
    """Lambert light and highlights (P, 3) at points (P, 3), with soft shadows painted in space."""
    best, points = hits
    normal = torch.nn.functional.normalize(torch.linalg.cross(quads.edge_u, quads.edge_v), dim=1)
    n = normal[best]
    to_eye = view.centre_m - points
    n = n * torch.where((n * to_eye).sum(1, keepdim=True) < 0, -1.0, 1.0)
    shadow = torch.sigmoid(6.0 * torch.sin(points @ lights.wave)) * lights.wave_depth
    light = points.new_full((len(points),), lights.ambient)
    shine = torch.zeros_like(light)
    mirrored = 2 * (n * to_eye).sum(1, keepdim=True) * n - to_eye
    mirrored = torch.nn.functional.normalize(mirrored, dim=1)
    for lamp, power in zip(lights.position, lights.power, strict=True):
        d = lamp - points
        r2 = (d * d).sum(1)
        inverse_r = r2.rsqrt()
        lambert = (d * n).sum(1).clamp(min=0) * inverse_r
        light = light + power * lambert / (0.3 + r2)
        shine = shine + ((mirrored * d).sum(1) * inverse_r).clamp(min=0) ** 40
    light = light * (1.0 - shadow).prod(1)
    return albedo * light.unsqueeze(1) + (quads.gloss[best] * shine).unsqueeze(1)
