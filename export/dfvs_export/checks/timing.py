"""Timing bundles side by side: each in a process of its own, their runs interleaved."""

from __future__ import annotations

import contextlib
import multiprocessing
import time
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass
from multiprocessing.connection import Connection
from pathlib import Path

import cv2
import numpy as np

from dfvs_common.child import end_worker_with_parent
from dfvs_core.errors import ConfigError, DfvsError, ModelError
from dfvs_export.bundles.runner import BundleRunner
from dfvs_models.bundle import read_bundle

_WARM_UP = 3
_KILOBYTES_PER_MEGABYTE = 1024.0
_PER_REPORT = 10


@dataclass(frozen=True, slots=True)
class BenchPlan:
    """Images of ``size`` (width, height) px, on so many threads, so many rounds."""

    size: tuple[int, int]
    threads: int = 2
    runs: int = 30

    def __post_init__(self) -> None:
        """Refuse what measures nothing."""
        for name, value in (("threads", self.threads), ("runs", self.runs)):
            if value < 1:
                raise ConfigError(f"{name} is {value}", "1 or more")


@dataclass(frozen=True, slots=True)
class BenchResult:
    """Times of one bundle.

    Parameters
    ----------
    bundle : str
        Its folder's name.
    precision : str
        ``"fp32"``, ``"fp16"`` or ``"int8"``, as its manifest says.
    median_ms, p99_ms : float
        One frame: encode it and match it to a goal whose features are kept (``encode-match``),
        or the whole network (``pair``, ``mono``).
    resident_mb : float
        Most memory that the process held, MB.
    """

    bundle: str
    precision: str
    median_ms: float
    p99_ms: float
    resident_mb: float

    def as_json(self) -> dict[str, object]:
        """Plain data."""
        return asdict(self)


def bench(
    folders: Sequence[Path], plan: BenchPlan, log: Callable[[str], None]
) -> list[BenchResult]:
    """Measure bundles; round by round every bundle has its turn, so that all meet the same load.

    Raises
    ------
    ModelError
        If a bundle cannot be used, or has another input size.
    """
    precisions = [_precision(folder, plan.size) for folder in folders]
    context = multiprocessing.get_context("spawn")
    workers: list[tuple[Connection, multiprocessing.process.BaseProcess]] = []
    try:
        for folder in folders:
            here, there = context.Pipe()
            process = context.Process(target=_work, args=(there, folder, plan), daemon=True)
            process.start()
            workers.append((here, process))
            there.close()
        times, memory = _rounds([pipe for pipe, _ in workers], plan.runs, log)
    finally:
        for pipe, worker in workers:
            pipe.close()
            worker.join(timeout=5.0)
            if worker.is_alive():
                worker.terminate()
    return [
        BenchResult(
            folder.resolve().name,
            precision,
            round(1e3 * float(np.median(samples)), 2),
            round(1e3 * float(np.percentile(samples, 99)), 2),
            round(megabytes, 1),
        )
        for folder, precision, samples, megabytes in zip(
            folders, precisions, times, memory, strict=True
        )
    ]


def _precision(folder: Path, size: tuple[int, int]) -> str:
    """Precision of a bundle; a ``pair`` takes images at ``size``, other kinds resize them."""
    manifest = read_bundle(folder).manifest
    if manifest.kind == "pair" and (manifest.input.width, manifest.input.height) != size:
        raise ModelError(
            f"bundle {folder.name} takes {manifest.input.width}x{manifest.input.height} px",
            f"{size[0]}x{size[1]}",
        )
    return manifest.precision


def _rounds(
    pipes: Sequence[Connection], runs: int, log: Callable[[str], None]
) -> tuple[list[list[float]], list[float]]:
    """Seconds of every worker's runs, and the most memory that each held, MB."""
    for pipe in pipes:
        _expect(pipe)  # ready and warm
    times: list[list[float]] = [[] for _ in pipes]
    for k in range(runs):
        for pipe, samples in zip(pipes, times, strict=True):
            pipe.send("run")
            samples.append(_expect(pipe))
        if (k + 1) % _PER_REPORT == 0 or k + 1 == runs:
            log(f"round {k + 1} of {runs}")
    memory = []
    for pipe in pipes:
        pipe.send("end")
        memory.append(_expect(pipe))
    return times, memory


def _expect(pipe: Connection) -> float:
    """Return a worker's number, or raise what it says went wrong."""
    try:
        answer = pipe.recv()
    except EOFError as error:
        raise ModelError("a measuring process ended by itself") from error
    if isinstance(answer, str):
        raise ModelError(answer)
    return float(answer)


def _work(pipe: Connection, folder: Path, plan: BenchPlan) -> None:
    """Serve one bundle: a run per request, in the order they come."""
    end_worker_with_parent()
    width, height = plan.size
    rng = np.random.default_rng(0)
    images = rng.integers(0, 256, (2, height, width, 3), dtype=np.uint8)
    try:
        runner = BundleRunner(read_bundle(folder), plan.threads)
        goal = runner.encode(images[1])
        for _ in range(_WARM_UP):
            runner.match(runner.encode(images[0]), goal)
    except (DfvsError, ValueError, cv2.error) as error:  # also what is not as its manifest says
        pipe.send(f"bundle {folder.name} cannot be run: {error}")
        return
    with contextlib.suppress(EOFError, OSError):  # another worker failed, and so all end
        pipe.send(0.0)
        while pipe.recv() == "run":
            start = time.perf_counter()
            runner.match(runner.encode(images[0]), goal)
            pipe.send(time.perf_counter() - start)
        pipe.send(_most_memory_mb())


def _most_memory_mb() -> float:
    """Return the most memory, MB, that this process held since it began to run this program.

    ``getrusage`` would count what its parent held before that.
    """
    for line in Path("/proc/self/status").read_text().splitlines():
        if line.startswith("VmHWM:"):
            return float(line.split()[1]) / _KILOBYTES_PER_MEGABYTE
    raise ModelError("this system does not tell how much memory a process holds", "Linux")
