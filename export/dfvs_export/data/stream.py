"""Training pairs as a stream: makers fill a folder with shards, the training draws from it."""

from __future__ import annotations

import collections
import contextlib
import multiprocessing
import time
from collections.abc import Callable
from pathlib import Path
from types import TracebackType

import numpy as np
import torch

from dfvs_core.errors import ConfigError
from dfvs_core.pair_files import PAIRS_PER_SHARD, shard_pattern
from dfvs_export.data.pairs import PairSettings
from dfvs_export.data.shards import Arrays, Batch, mirrored, read_shard, to_batch, write_shard

_SHARDS_AT_ONCE = 4
_WAIT_S = 0.5


def _make_forever(folder: Path, settings: PairSettings, seeds: tuple[int, int], keep: int) -> None:
    """Write shards of the seeds start, start + step, ...; keep the last ``keep`` of these.

    Whatever else lies in the folder, such as pairs from rendered rooms, is somebody's own.
    """
    torch.set_num_threads(1)
    seed, step = seeds
    made: collections.deque[Path] = collections.deque()
    while True:
        made.append(write_shard(folder, settings, PAIRS_PER_SHARD, seed))
        if len(made) > keep:
            made.popleft().unlink(missing_ok=True)
        seed += step


def _shards(folder: Path, settings: PairSettings) -> list[Path]:
    """Shards of one size, by seed."""
    return sorted(folder.glob(shard_pattern((settings.width, settings.height))))


class PairMakers:
    """Processes that make shards for as long as this context lasts."""

    def __init__(
        self, folder: Path, settings: PairSettings, count: int, first_seed: int, keep: int
    ) -> None:
        context = multiprocessing.get_context("spawn")
        self._processes = [
            context.Process(
                target=_make_forever,
                args=(folder, settings, (first_seed + k, count), max(1, keep // count)),
                daemon=True,
            )
            for k in range(count)
        ]

    def __enter__(self) -> PairMakers:
        """Start the processes."""
        for process in self._processes:
            process.start()
        return self

    def check(self) -> None:
        """Notice a maker that ended by itself.

        Raises
        ------
        ConfigError
            If one did.
        """
        ended = [p.exitcode for p in self._processes if not p.is_alive()]
        if ended:
            raise ConfigError(
                f"a process that makes pairs ended by itself (exit code {ended[0]})",
                "room on the disk and a folder that can be written",
                "its error stands above",
            )

    def __exit__(
        self,
        kind: type[BaseException] | None,
        value: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        """End the processes."""
        for process in self._processes:
            process.terminate()
        for process in self._processes:
            process.join()


class PairStream:
    """Batches drawn at random from the shards in a folder.

    What step k gets depends on the seed, k and the shards present alone.
    """

    def __init__(
        self, folder: Path, settings: PairSettings, batch: int, seed: int, wait_s: float
    ) -> None:
        if not 1 <= batch <= PAIRS_PER_SHARD:
            raise ConfigError(f"{batch} pairs per step", f"1 to {PAIRS_PER_SHARD}")
        self._folder, self._settings = folder, settings
        self._batch, self._seed, self._wait_s = batch, seed, wait_s
        self._round = -1
        self._pool: Arrays = {}
        self._order = np.zeros(0, dtype=np.int64)

    def batch(
        self,
        step: int,
        device: torch.device | str = "cpu",
        check: Callable[[], None] = lambda: None,
    ) -> Batch:
        """Return the pairs of one step; while there are no shards ``check`` may raise."""
        steps_per_round = max(1, PAIRS_PER_SHARD // self._batch)
        round_, place = divmod(step, steps_per_round)
        if round_ != self._round:
            self._load(round_, check)
        wanted = np.arange(place * self._batch, (place + 1) * self._batch)
        chosen = self._order[wanted % len(self._order)]
        pairs = {name: values[chosen] for name, values in self._pool.items()}
        return to_batch(mirrored(pairs, np.random.default_rng([self._seed, step])), device)

    def _load(self, round_: int, check: Callable[[], None]) -> None:
        rng = np.random.default_rng([self._seed, round_])
        shards: list[Arrays] = []
        while not shards:
            files = self._wait_for_shards(check)
            picked = rng.permutation(len(files))[:_SHARDS_AT_ONCE]
            with contextlib.suppress(FileNotFoundError):  # a maker deleted one: draw again
                shards = [read_shard(files[k]) for k in picked]
        self._pool = {name: np.concatenate([s[name] for s in shards]) for name in shards[0]}
        self._order = rng.permutation(len(self._pool["images"]))
        self._round = round_

    def _wait_for_shards(self, check: Callable[[], None]) -> list[Path]:
        deadline = time.monotonic() + self._wait_s
        while True:
            files = _shards(self._folder, self._settings)
            if files:
                return files
            if time.monotonic() > deadline:
                raise ConfigError(
                    f"no shards of {self._settings.width} x {self._settings.height} px "
                    f"in {self._folder}",
                    "training pairs",
                    "run with --makers 1 or more",
                )
            check()
            time.sleep(_WAIT_S)
