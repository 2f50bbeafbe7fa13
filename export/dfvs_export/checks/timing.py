"""Timing bundles side by side: each in a process of its own, their runs interleaved."""

import contextlib
import multiprocessing
import time
from collections.abc import Callable, Sequence
from concurrent.futures import ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np

from dfvs_common.child import end_worker_with_parent
from dfvs_common.progress import log
from dfvs_core.errors import ConfigError, DfvsError, ModelError
from dfvs_core.geometry.arrays import Float32Array, ImageArray
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
    """Times of one bundle."""

    bundle: str
    """Its folder's name."""
    precision: str
    """``"fp32"``, ``"fp16"`` or ``"int8"``, as its manifest says."""
    median_ms: float
    p99_ms: float
    """Both are of the networks' part of one frame, see ``run_frame``."""
    resident_mb: float
    """Most memory that the process held, MB."""


def bench(folders: Sequence[Path], plan: BenchPlan) -> list[BenchResult]:
    """Measure bundles; round by round every bundle has its turn, so that all meet the same load.

    Raises
    ------
    ModelError
        If a bundle cannot be used, or has another input size.
    """
    precisions = [_precision(folder, plan.size) for folder in folders]
    try:
        times, memory = _rounds(folders, plan)
    except BrokenProcessPool as error:
        raise ModelError("a measuring process ended by itself") from error
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


def _rounds(folders: Sequence[Path], plan: BenchPlan) -> tuple[list[list[float]], list[float]]:
    """Seconds of every bundle's runs, and the most memory that its process held, MB."""
    context = multiprocessing.get_context("spawn")
    with contextlib.ExitStack() as stack:
        workers = [
            stack.enter_context(ProcessPoolExecutor(1, context, end_worker_with_parent))
            for _ in folders
        ]
        loading = [
            worker.submit(_prepare, folder, plan)
            for worker, folder in zip(workers, folders, strict=True)
        ]
        for future in loading:
            future.result()
        times: list[list[float]] = [[] for _ in workers]
        for k in range(plan.runs):
            for worker, samples in zip(workers, times, strict=True):
                samples.append(worker.submit(_run).result())
            if (k + 1) % _PER_REPORT == 0 or k + 1 == plan.runs:
                log(f"round {k + 1} of {plan.runs}")
        return times, [worker.submit(_most_memory_mb).result() for worker in workers]


_bundle_run: list[Callable[[], object]] = []
"""In a measuring process: one run of its bundle."""


def _prepare(folder: Path, plan: BenchPlan) -> None:
    """Load a bundle in a measuring process, and run it until it is warm."""
    width, height = plan.size
    rng = np.random.default_rng(0)
    images = rng.integers(0, 256, (2, height, width, 3), dtype=np.uint8)
    try:
        runner = BundleRunner(read_bundle(folder), plan.threads)
        goal = runner.encode(images[1])
        _bundle_run[:] = [lambda: run_frame(runner, images[0], goal)]
        for _ in range(_WARM_UP):
            _run()
    except (DfvsError, ValueError, cv2.error) as error:  # also what is not as its manifest says
        raise ModelError(f"bundle {folder.name} cannot be run: {error}") from error


def run_frame(runner: BundleRunner, image: ImageArray, goal: list[Float32Array]) -> None:
    """Run the graphs as often as a frame does: encoded and matched, a ``pair`` network both ways.

    ``goal`` is what ``runner.encode`` gave of the goal image.
    """
    frame = runner.encode(image)
    runner.match(frame, goal)
    if runner.bundle.manifest.kind == "pair":
        runner.match(goal, frame)


def _run() -> float:
    """Seconds of a run."""
    start = time.perf_counter()
    _bundle_run[0]()
    return time.perf_counter() - start


def _most_memory_mb() -> float:
    """Return the most memory, MB, that this process held since it began to run this program.

    ``getrusage`` would count what its parent held before that.
    """
    for line in Path("/proc/self/status").read_text().splitlines():
        if line.startswith("VmHWM:"):
            return float(line.split()[1]) / _KILOBYTES_PER_MEGABYTE
    raise ModelError("this system does not tell how much memory a process holds", "Linux")
