"""A picture sheet of training pairs, to be looked at before a long run."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
import torch
from numpy.typing import NDArray

from dfvs_core.errors import ConfigError
from dfvs_export.data.pairs import Pair, PairSettings, make_pair
from dfvs_export.data.photometric import disturb
from dfvs_export.data.shards import TEXTURES_PER_SHARD
from dfvs_export.data.textures import make_texture_bank

_HIDDEN_COLOUR = np.array([1.0, 0.0, 1.0], dtype=np.float32)
_COLUMNS = 2


def warp_back(image_b: NDArray[np.float32], flow_ab: NDArray[np.float32]) -> NDArray[np.float32]:
    """Second image (H, W, 3) taken to the first one's grid by the flow (H, W, 2) px."""
    h, w = flow_ab.shape[:2]
    y, x = np.mgrid[:h, :w].astype(np.float32)
    mapped = cv2.remap(image_b, x + flow_ab[..., 0], y + flow_ab[..., 1], cv2.INTER_LINEAR)
    return np.asarray(mapped, dtype=np.float32)


def write_sheet(path: Path, settings: PairSettings, count: int, seed: int) -> None:
    """Draw pairs: first, second, second warped to the first (magenta: hidden), both disturbed.

    Raises
    ------
    ConfigError
        If the picture cannot be written.
    """
    if count < 1:
        raise ConfigError(f"{count} pairs", "1 or more")
    if path.suffix.lower() not in (".png", ".jpg", ".jpeg"):
        raise ConfigError(f"cannot write {path}", "a .png or .jpg file")
    torch.manual_seed(seed)
    g = torch.Generator().manual_seed(seed)
    bank = make_texture_bank(TEXTURES_PER_SHARD, g)
    rows = [_row(make_pair(bank, settings, g)) for _ in range(count)]
    blank = np.zeros_like(rows[0])
    rows += [blank] * (-len(rows) % _COLUMNS)
    per_column = len(rows) // _COLUMNS
    columns = [np.concatenate(rows[k * per_column : (k + 1) * per_column]) for k in range(_COLUMNS)]
    sheet = (np.concatenate(columns, axis=1) * 255.0).round().astype(np.uint8)
    if not cv2.imwrite(str(path), cv2.cvtColor(sheet, cv2.COLOR_RGB2BGR)):
        raise ConfigError(f"cannot write {path}", "a .png or .jpg file in an existing folder")


def _row(pair: Pair) -> NDArray[np.float32]:
    """One pair side by side (H, 5 W, 3)."""
    a, b = pair.image_a.clamp(0, 1), pair.image_b.clamp(0, 1)
    warped = warp_back(b.numpy(), pair.flow_ab.numpy())
    shown = np.where(pair.visible_a.numpy()[..., None], warped, _HIDDEN_COLOUR)
    damaged = disturb(torch.stack([a, b]).permute(0, 3, 1, 2)).permute(0, 2, 3, 1).numpy()
    row = np.concatenate([a.numpy(), b.numpy(), shown, damaged[0], damaged[1]], axis=1)
    return np.asarray(row, dtype=np.float32)
