"""What the trainings of all networks share: checks of settings, batches, and the descent."""

import math
import time
from collections.abc import Callable, Iterator, Mapping
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path
from typing import ClassVar, TypeVar

import torch
from torch import nn

from dfvs_common.command_line import require_file
from dfvs_core.errors import ConfigError

T = TypeVar("T")

ENCODER_RATE = 0.3
"""Learning rate of an encoder in that of the rest of its network."""
_WARM_UP_STEPS = 50
_WEIGHT_DECAY = 1e-4


@dataclass(frozen=True, slots=True, kw_only=True)
class TrainSettings:
    """What every training run is asked for; see ``dfvs-export train --help``.

    Raises
    ------
    ConfigError
        If it trains nothing, no random numbers have its seed, or its checkpoint lies in no folder
        or is one.
    """

    pairs: Path
    out: Path
    start: Path | None
    minutes: float
    learning_rate: float
    seed: int
    threads: int

    POSITIVE: ClassVar[tuple[str, ...]] = ("minutes", "learning_rate", "threads")

    def __post_init__(self) -> None:
        """Refuse what trains nothing."""
        for name in self.POSITIVE:
            if not getattr(self, name) > 0:
                raise ConfigError(f"{name} is {getattr(self, name)}", "more than 0")
        if self.seed < 0:
            raise ConfigError(f"--seed is {self.seed}", "0 or more")
        require_file("--out", self.out)

    def history(self, before: str, what: str) -> str:
        """Paragraph for the model card: how the weights came about, and what was learnt since."""
        return f"{before} Then: {what}, learning rate {self.learning_rate:g}, seed {self.seed}."


def bfloat16_where_quick() -> torch.autocast:
    """Context of a network's steps in bfloat16, on processors that have instructions for it.

    Others emulate them, several times slower than float32, in which they compute here.
    """
    able = torch.cpu.get_capabilities()
    is_quick = any(able.get(name, False) for name in ("avx512_bf16", "amx_bf16"))
    return torch.autocast("cpu", torch.bfloat16, enabled=is_quick)


def drawn_ahead(draw: Callable[[], T]) -> Iterator[T]:
    """Batches without end; the next one is drawn while the last one is learnt from."""
    with ThreadPoolExecutor(1) as pool:
        following = pool.submit(draw)
        while True:
            batch = following.result()
            following = pool.submit(draw)
            yield batch


def descend(
    settings: TrainSettings,
    rates: Mapping[nn.Module, float],
    learn: Callable[[], None],
    every: Mapping[Callable[[int], None], int],
) -> None:
    """Take steps of AdamW, whose rate rises over the first ones and falls to 0 by a cosine.

    ``rates`` are factors on the learning rate by module; what an earlier module owns is not the
    later one's. ``learn`` adds the gradients of a step. Each of ``every`` is called with the count
    of steps, after so many of them and at the end.
    """
    torch.set_num_threads(settings.threads)
    groups = _groups({module: rate * settings.learning_rate for module, rate in rates.items()})
    parameters = [p for group in groups for p in group["params"]]  # type: ignore[attr-defined]
    optimiser = torch.optim.AdamW(groups, weight_decay=_WEIGHT_DECAY)
    began, done, steps = time.monotonic(), 0.0, 0
    while done < 1.0:
        learn()
        steps += 1
        factor = min(1.0, steps / _WARM_UP_STEPS) * 0.5 * (1.0 + math.cos(math.pi * done))
        for group in optimiser.param_groups:
            group["lr"] = factor * group["rate"]
        nn.utils.clip_grad_norm_(parameters, 1.0)
        optimiser.step()
        optimiser.zero_grad()
        done = (time.monotonic() - began) / (60.0 * settings.minutes)
        for act, period in every.items():
            if steps % period == 0 or done >= 1.0:
                act(steps)


def _groups(rates: Mapping[nn.Module, float]) -> list[dict[str, object]]:
    groups, taken = [], set[int]()
    for module, rate in rates.items():
        new = [p for p in module.parameters() if p.requires_grad and id(p) not in taken]
        taken |= {id(p) for p in module.parameters()}
        if new:
            groups.append({"params": new, "lr": rate, "rate": rate})
    return groups
