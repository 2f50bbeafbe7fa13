"""Timing bundles side by side: each in a process of its own, their runs interleaved."""

from __future__ import annotations

import contextlib
import multiprocessing
import time
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from multiprocessing.connection import Connection
from pathlib import Path

import numpy as np

from dfvs_core.errors import DfvsError, ModelError

_WARM_UP = 3
_KILOBYTES_PER_MEGABYTE = 1024.0


@dataclass(frozen=True, slots=True)
class BenchResult:
    """Times of one bundle.

    Parameters
    ----------
    bundle : str
        Its folder's name.
    precision : str
        ``"fp32"``, or ``"int8"`` where the bundle's name says so.
    median_ms, p99_ms : float
        One frame: encode it and match it to a goal whose features are kept (``encode-match``),
        or the whole network (``pair``).
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
    folders: Sequence[Path], size: tuple[int, int], threads: int, runs: int
) -> list[BenchResult]:
    """Measure bundles; round by round every bundle has its turn, so that all meet the same load.

    Raises
    ------
    ModelError
        If a bundle cannot be used, or has another input size.
    """
    context = multiprocessing.get_context("spawn")
    workers: list[tuple[Connection, multiprocessing.process.BaseProcess]] = []
    try:
        for folder in folders:
            here, there = context.Pipe()
            process = context.Process(target=_work, args=(there, folder, size, threads))
            process.start()
            workers.append((here, process))
        for pipe, _ in workers:
            _expect(pipe)  # ready and warm
        times: list[list[float]] = [[] for _ in workers]
        for _ in range(runs):
            for (pipe, _), samples in zip(workers, times, strict=True):
                pipe.send("run")
                samples.append(_expect(pipe))
        memory = []
        for pipe, _ in workers:
            pipe.send("end")
            memory.append(_expect(pipe))
    finally:
        for pipe, worker in workers:
            pipe.close()
            worker.join(timeout=5.0)
            if worker.is_alive():
                worker.terminate()
    return [
        BenchResult(
            folder.name,
            "int8" if "int8" in folder.name else "fp32",
            round(1e3 * float(np.median(samples)), 2),
            round(1e3 * float(np.percentile(samples, 99)), 2),
            round(megabytes, 1),
        )
        for folder, samples, megabytes in zip(folders, times, memory, strict=True)
    ]


def _expect(pipe: Connection) -> float:
    """Return a worker's number, or raise what it says went wrong."""
    try:
        answer = pipe.recv()
    except EOFError as error:
        raise ModelError("a measuring process ended by itself") from error
    if isinstance(answer, str):
        raise ModelError(answer)
    return float(answer)


def _work(pipe: Connection, folder: Path, size: tuple[int, int], threads: int) -> None:
    """Serve one bundle: a run per request, in the order they come."""
    from dfvs_export.bundles import read_bundle
    from dfvs_export.running import FlowRunner

    try:
        manifest, contents = read_bundle(folder)
        if (manifest.input.width, manifest.input.height) != size:
            raise ModelError(
                f"bundle {folder.name} takes {manifest.input.width}x{manifest.input.height} px",
                f"{size[0]}x{size[1]}",
            )
        runner = FlowRunner(manifest, contents, threads)
    except DfvsError as error:
        pipe.send(str(error))
        return
    rng = np.random.default_rng(0)
    images = rng.integers(0, 256, (2, size[1], size[0], 3), dtype=np.uint8)
    goal = runner.encode(images[1])
    for _ in range(_WARM_UP):
        runner.match(runner.encode(images[0]), goal)
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
