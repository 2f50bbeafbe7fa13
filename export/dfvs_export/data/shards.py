"""Shards: packets of ready pairs on disk, written by makers and read by the training.

``dfvs_core.pair_files`` says what is in a shard; ``dfvs-sim pairs`` writes the same.
"""

from __future__ import annotations

import os
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from dfvs_core.pair_files import MAX_FLOW_SIDES, SHARD_ARRAYS, shard_name
from dfvs_export.data.pairs import Pair, PairSettings, make_pair
from dfvs_export.data.textures import make_texture_bank

TEXTURES_PER_SHARD = 64
_MIRRORED_SHARE = 0.3
Arrays = dict[str, NDArray[Any]]


@dataclass(frozen=True, slots=True)
class Batch:
    """Pairs ready for training: both directions of N pairs.

    Parameters
    ----------
    images : (N, 2, 3, H, W) float32
        In [0, 1].
    flows : (N, 2, 2, H, W) float32
        px, a to b and b to a.
    visible, solid : (N, 2, H, W) bool
        Seen in both; the flow means something.
    """

    images: Tensor
    flows: Tensor
    visible: Tensor
    solid: Tensor


def make_shard(settings: PairSettings, count: int, seed: int) -> Arrays:
    """Make the arrays of one shard; the seed alone decides what is in it."""
    g = torch.Generator().manual_seed(seed)
    bank = make_texture_bank(TEXTURES_PER_SHARD, g)
    pairs = [make_pair(bank, settings, g) for _ in range(count)]
    return {
        "images": np.stack([_images(p) for p in pairs]),
        "flows": np.stack([_flows(p) for p in pairs]),
        "visible": np.stack([torch.stack([p.visible_a, p.visible_b]).numpy() for p in pairs]),
        "solid": np.stack([torch.stack([p.solid_a, p.solid_b]).numpy() for p in pairs]),
    }


def write_shard(folder: Path, settings: PairSettings, count: int, seed: int) -> Path:
    """Make a shard and put it in place whole, so that a reader never sees half of it."""
    folder.mkdir(parents=True, exist_ok=True)
    path = folder / shard_name((settings.width, settings.height), seed)
    part = path.with_suffix(f".{os.getpid()}.part")
    with part.open("wb") as file:
        np.savez(file, allow_pickle=False, **make_shard(settings, count, seed))
    part.replace(path)
    return path


def read_shard(path: Path) -> Arrays:
    """Arrays of a shard."""
    with np.load(path, allow_pickle=False) as arrays:
        return {name: arrays[name] for name in SHARD_ARRAYS}


def mirrored(arrays: Arrays, rng: np.random.Generator) -> Arrays:
    """Mirror every pair, or not, left to right and top to bottom, at random."""
    made = {name: values.copy() for name, values in arrays.items()}
    count = len(made["images"])
    for axis, component in ((-1, 0), (-2, 1)):  # columns and u, rows and v
        chosen = rng.random(count) < _MIRRORED_SHARE
        for values in made.values():
            values[chosen] = np.flip(values[chosen], axis)
        made["flows"][chosen, :, component] *= -1
    return made


def to_batch(arrays: Arrays, device: torch.device | str = "cpu") -> Batch:
    """Take a shard's arrays, or a part of each, to tensors."""
    return Batch(
        torch.from_numpy(arrays["images"]).to(device).float() / 255.0,
        torch.from_numpy(arrays["flows"]).to(device).float(),
        torch.from_numpy(arrays["visible"]).to(device),
        torch.from_numpy(arrays["solid"]).to(device),
    )


def _images(pair: Pair) -> NDArray[np.generic]:
    stack = torch.stack([pair.image_a, pair.image_b]).permute(0, 3, 1, 2)
    return (stack.clamp(0.0, 1.0) * 255.0).round().to(torch.uint8).numpy()


def _flows(pair: Pair) -> NDArray[np.generic]:
    limit = MAX_FLOW_SIDES * max(pair.flow_ab.shape[:2])
    stack = torch.stack([pair.flow_ab, pair.flow_ba]).permute(0, 3, 1, 2)
    return stack.clamp(-limit, limit).to(torch.float16).numpy()
