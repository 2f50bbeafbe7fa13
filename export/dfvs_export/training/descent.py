"""What the trainings of all networks share: checks of settings, batches, and the descent."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import TypeVar

import torch
from torch import nn

from dfvs_core.errors import ConfigError

T = TypeVar("T")

_WARM_UP_STEPS = 50
_WEIGHT_DECAY = 1e-4


def check_training(settings: object, out: Path, positive: Sequence[str]) -> None:
    """Refuse settings that train nothing, or whose checkpoint lies in no folder.

    Raises
    ------
    ConfigError
        If one of the ``positive`` fields is not, or ``out`` cannot be written.
    """
    for name in positive:
        if not getattr(settings, name) > 0:
            raise ConfigError(f"{name} is {getattr(settings, name)}", "more than 0")
    if not out.absolute().parent.is_dir():
        raise ConfigError(f"{out} lies in no folder", "an existing folder")


def drawn_ahead(draw: Callable[[], T]) -> Iterator[T]:
    """Batches without end; the next one is drawn while the last one is learnt from."""
    with ThreadPoolExecutor(1) as pool:
        following = pool.submit(draw)
        while True:
            batch = following.result()
            following = pool.submit(draw)
            yield batch


class Descent:
    """AdamW whose rate rises over the first steps and falls to 0 by a cosine.

    Parameters
    ----------
    rates : mapping
        Learning rate by module; what an earlier module owns is not the later one's.
    """

    def __init__(self, rates: Mapping[nn.Module, float]) -> None:
        groups = _groups(rates)
        self._parameters = [p for group in groups for p in group["params"]]  # type: ignore[attr-defined]
        self._optimiser = torch.optim.AdamW(groups, weight_decay=_WEIGHT_DECAY)
        self._steps = 0

    def step(self, done: float) -> None:
        """Take a step with the gradients there are; ``done`` is the share of the run so far."""
        self._steps += 1
        factor = min(1.0, self._steps / _WARM_UP_STEPS) * 0.5 * (1.0 + math.cos(math.pi * done))
        for group in self._optimiser.param_groups:
            group["lr"] = factor * group["rate"]
        nn.utils.clip_grad_norm_(self._parameters, 1.0)
        self._optimiser.step()
        self._optimiser.zero_grad()


def _groups(rates: Mapping[nn.Module, float]) -> list[dict[str, object]]:
    groups, taken = [], set[int]()
    for module, rate in rates.items():
        new = [p for p in module.parameters() if p.requires_grad and id(p) not in taken]
        taken |= {id(p) for p in module.parameters()}
        if new:
            groups.append({"params": new, "lr": rate, "rate": rate})
    return groups
