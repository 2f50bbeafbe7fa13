"""Evaluation files of pairs (``dfvs_models.evaluation_file`` tells what is in them)."""

import io
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dfvs_common.atomic_file import replace_file
from dfvs_models.evaluation import LEVELS
from dfvs_rooms.pairs.drawing import ViewPair
from dfvs_sim.scene.frames import gltf_pose_from_ned

Arrays = dict[str, NDArray[Any]]


def evaluation_arrays(pairs: Sequence[ViewPair], levels: Sequence[str]) -> Arrays:
    """Arrays of an evaluation file of pairs and their levels; flow is 0 where it means nothing."""
    limit = np.finfo(np.float16).max
    flow = np.stack([pair.flow for pair in pairs])
    return {
        "IA": np.stack([pair.views[0].image for pair in pairs]),
        "IB": np.stack([pair.views[1].image for pair in pairs]),
        "flow": np.clip(np.nan_to_num(flow, nan=0.0), -limit, limit).astype(np.float16),
        "vis": np.stack([pair.visible for pair in pairs]),
        "depth": np.stack([pair.views[0].depth_m for pair in pairs]).astype(np.float16),
        "TA": np.stack([gltf_pose_from_ned(pair.poses[0]) for pair in pairs]),
        "TB": np.stack([gltf_pose_from_ned(pair.poses[1]) for pair in pairs]),
        "level": np.array([LEVELS.index(level) for level in levels], np.int64),
    }


def write_arrays(path: Path, arrays: Arrays) -> None:
    """Write an ``.npz`` and put it in place whole, so that a reader never sees half of it.

    Raises
    ------
    ConfigError
        If it cannot be written.
    """
    file = io.BytesIO()
    np.savez_compressed(file, allow_pickle=False, **arrays)
    replace_file(path, file.getvalue())
