"""What a training run is told."""

from __future__ import annotations

import math
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from dfvs_core.errors import ConfigError
from dfvs_export.data.pairs import PairSettings
from dfvs_export.networks.architecture import FlowArchitecture


@dataclass(frozen=True, slots=True)
class TrainSettings:
    """One run of the training.

    Parameters
    ----------
    out : Path
        Folder for checkpoints, shards and curves.
    minutes : float
        How long to train; the learning rate falls along this time.
    steps : int or None
        Train this many steps instead; then a resumed run repeats to the last bit.
    pairs_per_step : int
        Pairs, each used in both directions.
    learning_rate : float
        Peak of the schedule (3 % warm-up, then a cosine down to 1 %).
    seed : int
        Decides weights, pairs and disturbances.
    makers : int
        Processes that make training pairs beside the training; 0 to use what lies in ``pairs``.
    precision : str
        ``"bf16"`` (autocast) or ``"fp32"``.
    device : str
        ``"cpu"``, ``"cuda"``...
    threads : int
        Threads of torch on the CPU.
    pairs : Path or None
        Folder of shards; ``out / "pairs"`` unless given.
    keep_shards : int
        Shards kept on disk; older ones are deleted when makers run.
    validation : Path or None
        Pairs in the benchmark's ``.npz`` layout to measure every checkpoint on.
    keep_norms : bool
        Leave the statistics of batch normalisation as they are in the checkpoint.
    checkpoint_minutes : float
        Time between checkpoints.
    """

    out: Path
    minutes: float = 60.0
    steps: int | None = None
    pairs_per_step: int = 8
    learning_rate: float = 6e-4
    seed: int = 0
    makers: int = 1
    precision: str = "bf16"
    device: str = "cpu"
    threads: int = 2
    size: tuple[int, int] = (192, 144)
    pairs: Path | None = None
    keep_shards: int = 120
    validation: Path | None = None
    keep_norms: bool = False
    checkpoint_minutes: float = 5.0

    def __post_init__(self) -> None:
        """Refuse what cannot be trained."""
        if self.size[0] % 16 or self.size[1] % 16:
            raise ConfigError(f"size {self.size} px", "multiples of 16")
        if self.precision not in ("bf16", "fp32"):
            raise ConfigError(f"precision {self.precision!r}", "'bf16' or 'fp32'")
        if self.steps is None and not 0 < self.minutes < math.inf:
            raise ConfigError(f"minutes = {self.minutes}", "a positive number")
        if self.steps is not None and self.steps < 1:
            raise ConfigError(f"steps = {self.steps}", "1 or more")
        least = {"threads": 1, "makers": 0, "keep_shards": 1}
        for name, limit in least.items():
            if getattr(self, name) < limit:
                raise ConfigError(f"{name} = {getattr(self, name)}", f"{limit} or more")
        if not 0 < self.learning_rate < math.inf:
            raise ConfigError(f"learning_rate = {self.learning_rate}", "a positive number")

    @property
    def pairs_folder(self) -> Path:
        """Where the shards are."""
        return self.pairs or self.out / "pairs"

    def pair_settings(self) -> PairSettings:
        """What the makers draw."""
        return PairSettings(*self.size)


def describe(settings: TrainSettings, architecture: FlowArchitecture) -> dict[str, Any]:
    """Settings and architecture as plain data, for checkpoints and model cards."""
    plain = {k: str(v) if isinstance(v, Path) else v for k, v in asdict(settings).items()}
    return {"settings": plain, "architecture": asdict(architecture)}
