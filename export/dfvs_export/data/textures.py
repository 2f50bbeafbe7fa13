"""A bank of procedural textures with its mip pyramids, as one flat table of texels."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import torch
from torch import Tensor
from torch.nn import functional

_Kind = Callable[[torch.Generator], Tensor]
TEXTURE_SIZE = 256
MIP_LEVELS = 8
_LEVEL_OFFSETS = [0]
for _level in range(MIP_LEVELS):
    _LEVEL_OFFSETS.append(_LEVEL_OFFSETS[-1] + (TEXTURE_SIZE >> _level) ** 2)
TEXELS_PER_TEXTURE = _LEVEL_OFFSETS[-1]


@dataclass(frozen=True, slots=True)
class TextureBank:
    """Textures as texels.

    Parameters
    ----------
    texels : (T * TEXELS_PER_TEXTURE, 3) float32
        Linear base colour in [0, 1]; per texture its mip levels, finest first, row by row.
    count : int
        Number T of textures.
    """

    texels: Tensor
    count: int

    def sample(self, texture: Tensor, uv: Tensor, level: Tensor) -> Tensor:
        """Trilinear look-up with wrap-around.

        Parameters
        ----------
        texture : (N,) int64
            Texture of each sample.
        uv : (N, 2) float32
            Position in texels of the finest level.
        level : (N,) float32
            Mip level, fractional.

        Returns
        -------
        Tensor
            (N, 3) float32 colours.
        """
        level = level.clamp(0.0, MIP_LEVELS - 1.001)
        low = level.floor()
        part = (level - low).unsqueeze(1)
        low = low.long()
        fine = self._bilinear(texture, uv, low)
        return fine + part * (self._bilinear(texture, uv, low + 1) - fine)

    def _bilinear(self, texture: Tensor, uv: Tensor, level: Tensor) -> Tensor:
        size = TEXTURE_SIZE >> level
        start = texture * TEXELS_PER_TEXTURE + torch.tensor(
            _LEVEL_OFFSETS, device=level.device
        ).take(level)
        p = uv * torch.exp2(-level.to(uv.dtype)).unsqueeze(1) - 0.5
        base = p.floor()
        fx, fy = (p - base).unbind(1)
        mask = size - 1
        x0, y0 = (base[:, 0].long() & mask), (base[:, 1].long() & mask)
        x1, y1 = (x0 + 1) & mask, (y0 + 1) & mask
        row0, row1 = start + y0 * size, start + y1 * size
        t = self.texels
        top = torch.lerp(t[row0 + x0], t[row0 + x1], fx.unsqueeze(1))
        bottom = torch.lerp(t[row1 + x0], t[row1 + x1], fx.unsqueeze(1))
        return torch.lerp(top, bottom, fy.unsqueeze(1))


def make_texture_bank(
    count: int, generator: torch.Generator, device: torch.device | str = "cpu"
) -> TextureBank:
    """Draw ``count`` random textures, the first quarter of them plain.

    ``generator`` lives on the CPU, the bank on ``device``.
    """
    kinds = [_plain if k < count // 4 else None for k in range(count)]
    pyramids = [_pyramid(_random_texture(generator, kind)) for kind in kinds]
    return TextureBank(torch.cat(pyramids).to(device), count)


def _pyramid(texture: Tensor) -> Tensor:
    """All mip levels (TEXELS_PER_TEXTURE, 3) of a texture (3, S, S)."""
    levels = [texture.flatten(1).T]
    for _ in range(MIP_LEVELS - 1):
        texture = functional.avg_pool2d(texture.unsqueeze(0), 2).squeeze(0)
        levels.append(texture.flatten(1).T)
    return torch.cat(levels).contiguous()


def _random_texture(g: torch.Generator, kind: _Kind | None) -> Tensor:
    """One texture (3, S, S) in [0, 1], of a random kind unless one is named."""
    if kind is None:
        weights = torch.tensor([weight for weight, _ in _KINDS])
        kind = _KINDS[int(torch.multinomial(weights, 1, generator=g))][1]
    texture = kind(g)
    grain = _uniform(g, 0.0, 0.05) * torch.randn(1, TEXTURE_SIZE, TEXTURE_SIZE, generator=g)
    return (texture + grain).clamp(0.0, 1.0)


def _uniform(g: torch.Generator, low: float, high: float) -> float:
    return low + (high - low) * float(torch.rand((), generator=g))


def _integer(g: torch.Generator, low: int, high: int) -> int:
    """Draw a whole number in [low, high)."""
    return int(torch.randint(low, high, (), generator=g))


def _colour(g: torch.Generator) -> Tensor:
    """Colour (3, 1, 1), often near grey, as in most rooms."""
    grey = torch.rand(1, generator=g)
    hue = torch.rand(3, generator=g)
    colour = torch.lerp(grey.expand(3), hue, _uniform(g, 0.0, 0.8) ** 1.5)
    return colour.reshape(3, 1, 1)


def _grid() -> tuple[Tensor, Tensor]:
    """Texel centres (S, S) along x and y."""
    axis = torch.arange(TEXTURE_SIZE) + 0.5
    y, x = torch.meshgrid(axis, axis, indexing="ij")
    return x, y


def _noise(g: torch.Generator, channels: int, coarsest: int, octaves: int) -> Tensor:
    """Periodic-looking value noise (channels, S, S) of about unit range around zero."""
    total = torch.zeros(channels, TEXTURE_SIZE, TEXTURE_SIZE)
    weight = 1.0
    for octave in range(octaves):
        cells = min(coarsest << octave, TEXTURE_SIZE)
        seed = torch.rand(1, channels, cells, cells, generator=g) - 0.5
        size = (TEXTURE_SIZE, TEXTURE_SIZE)
        total += (
            weight * functional.interpolate(seed, size, mode="bilinear", align_corners=False)[0]
        )
        weight *= 0.6
    return total


def _plain(g: torch.Generator) -> Tensor:
    cloud = _noise(g, 1, _integer(g, 1, 5), 2)
    return _colour(g) + _uniform(g, 0.0, 0.08) * cloud


def _cloudy(g: torch.Generator) -> Tensor:
    channels = 3 if _uniform(g, 0, 1) < 0.5 else 1
    coarsest, octaves = _integer(g, 2, 12), _integer(g, 2, 6)
    return _colour(g) + _uniform(g, 0.2, 1.0) * _noise(g, channels, coarsest, octaves)


def _bricks(g: torch.Generator) -> Tensor:
    x, y = _grid()
    columns, rows = _integer(g, 1, 9), _integer(g, 1, 13)
    shift = _uniform(g, 0, 1) if _uniform(g, 0, 1) < 0.5 else 0.0
    v = y * rows / TEXTURE_SIZE
    u = x * columns / TEXTURE_SIZE + shift * v.floor()
    edge = torch.minimum(
        ((u % 1) - 0.5).abs().neg() + 0.5, (((v % 1) - 0.5).abs().neg() + 0.5) * columns / rows
    )
    tone = torch.rand(rows, columns, generator=g)[v.long() % rows, u.floor().long() % columns]
    face = _colour(g) * (1.0 + _uniform(g, 0.0, 0.6) * (tone - 0.5))
    face = face + _uniform(g, 0.0, 0.3) * _noise(g, 1, 8, 3)
    joint = (edge < _uniform(g, 0.005, 0.06)).float()
    return torch.lerp(face, _colour(g).expand_as(face), joint)


def _stripes(g: torch.Generator) -> Tensor:
    x, y = _grid()
    kx, ky = _integer(g, 0, 17), _integer(g, 0, 9)
    phase = (kx * x + ky * y) / TEXTURE_SIZE
    wave = torch.sin(2 * math.pi * phase + _uniform(g, 0, 4) * _noise(g, 1, 4, 2)[0])
    soft = _uniform(g, 1.0, 30.0)
    amount = torch.sigmoid(soft * (wave - _uniform(g, -0.7, 0.7))).unsqueeze(0)
    return torch.lerp(_colour(g).expand(3, *x.shape), _colour(g).expand(3, *x.shape), amount)


def _checks(g: torch.Generator) -> Tensor:
    x, y = _grid()
    n = 2 * _integer(g, 1, 9)
    field = ((x * n / TEXTURE_SIZE).floor() + (y * n / TEXTURE_SIZE).floor()) % 2
    base = torch.lerp(_colour(g).expand(3, *x.shape), _colour(g).expand(3, *x.shape), field)
    return base + _uniform(g, 0.0, 0.3) * _noise(g, 1, 4, 4)


def _polygons(g: torch.Generator) -> Tensor:
    x, y = _grid()
    texture = _cloudy(g) if _uniform(g, 0, 1) < 0.5 else _plain(g).expand(3, *x.shape).clone()
    for _ in range(_integer(g, 4, 28)):
        cx, cy = _uniform(g, 0, TEXTURE_SIZE), _uniform(g, 0, TEXTURE_SIZE)
        radius = TEXTURE_SIZE * 0.5 * _uniform(g, 0.1, 0.8) ** 2
        sides = _integer(g, 3, 7)
        start = _uniform(g, 0, 2 * math.pi)
        inside = torch.full_like(x, -1e9)
        for k in range(sides):
            angle = start + 2 * math.pi * k / sides
            reach = (x - cx) * math.cos(angle) + (y - cy) * math.sin(angle)
            inside = torch.maximum(inside, reach - radius * _uniform(g, 0.4, 1.0))
        texture = torch.where(inside.unsqueeze(0) < 0, _colour(g), texture)
    return texture


def _spots(g: torch.Generator) -> Tensor:
    x, y = _grid()
    texture = _plain(g).expand(3, *x.shape).clone()
    palette = [_colour(g) for _ in range(3)]
    for _ in range(_integer(g, 5, 40)):
        cx, cy = _uniform(g, 0, TEXTURE_SIZE), _uniform(g, 0, TEXTURE_SIZE)
        radius = 3.0 + 45.0 * _uniform(g, 0, 1) ** 2
        inside = (x - cx) ** 2 + (y - cy) ** 2 < radius**2
        texture = torch.where(inside.unsqueeze(0), palette[_integer(g, 0, 3)], texture)
    return texture


def _glyphs(g: torch.Generator) -> Tensor:
    """Rows of random little bitmaps, as print, book spines and buttons look."""
    cell = 2 ** _integer(g, 0, 3)
    rows, columns = TEXTURE_SIZE // (12 * cell) + 1, TEXTURE_SIZE // (8 * cell) + 1
    letters = (torch.rand(rows, columns, 7, 5, generator=g) < 0.5).float()
    letters *= (torch.rand(rows, columns, 1, 1, generator=g) < 0.8).float()
    page = functional.pad(letters, (1, 2, 2, 3)).permute(0, 2, 1, 3).reshape(rows * 12, columns * 8)
    page = page.repeat_interleave(cell, 0).repeat_interleave(cell, 1)
    ink = page[:TEXTURE_SIZE, :TEXTURE_SIZE].unsqueeze(0)
    paper = _plain(g).expand(3, TEXTURE_SIZE, TEXTURE_SIZE)
    return torch.lerp(paper, _colour(g).expand_as(paper), ink)


def _wood(g: torch.Generator) -> Tensor:
    x, y = _grid()
    bend = _noise(g, 1, 3, 3)[0]
    ring = (y / TEXTURE_SIZE * _integer(g, 2, 10) + _uniform(g, 0.5, 3.0) * bend) % 1
    fibre = functional.interpolate(
        torch.rand(1, 1, 128, 6, generator=g), (TEXTURE_SIZE, TEXTURE_SIZE), mode="bilinear"
    )[0, 0]
    planks = ((x / TEXTURE_SIZE * _integer(g, 1, 6)) % 1 > 0.02).float()
    tone = 1.0 - _uniform(g, 0.05, 0.4) * ring - _uniform(g, 0.0, 0.4) * fibre
    warm = torch.tensor([1.0, 0.75, 0.5]).reshape(3, 1, 1) * _uniform(g, 0.2, 1.0)
    return torch.lerp(warm, _colour(g), 0.3) * tone * (0.4 + 0.6 * planks)


_KINDS: tuple[tuple[float, _Kind], ...] = (
    (2.0, _plain),
    (4.0, _cloudy),
    (2.5, _bricks),
    (1.5, _stripes),
    (1.0, _checks),
    (3.0, _polygons),
    (1.5, _spots),
    (2.0, _glyphs),
    (2.5, _wood),
)
