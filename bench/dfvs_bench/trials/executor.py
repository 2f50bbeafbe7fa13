"""Who does the work: this process, several of this machine, or a Dask cluster."""

import importlib
import multiprocessing
import signal
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, Executor, Future, ProcessPoolExecutor, wait
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any, TypeVar

from dfvs_common.child import end_worker_with_parent
from dfvs_common.command_line import require_range
from dfvs_core.errors import ConfigError

_Job = TypeVar("_Job")
_Result = TypeVar("_Result")
_MOST_WORKERS = 256
_SIGNALS_S = 1.0
"""Longest time until a signal is handled."""
_LOST_WORKERS = frozenset({"BrokenProcessPool", "KilledWorker"})
"""How a pool and Dask, which need not be installed, call it."""


@dataclass(frozen=True, slots=True)
class TrialExecutor:
    """Where jobs are done.

    Raises
    ------
    ConfigError
        If the number of workers is out of range, or given beside a scheduler.
    """

    workers: int = 1
    """Processes of this machine; 1 is this very process."""
    dask: str | None = None
    """Address of a Dask scheduler, such as ``tcp://127.0.0.1:8786``, which is used instead. Its
    workers need this package, the scene files at the same paths, and the matcher.
    """

    def __post_init__(self) -> None:
        """Refuse what cannot be."""
        require_range(self, 1, _MOST_WORKERS, "workers")
        if self.dask is not None and self.workers > 1:
            raise ConfigError(
                f"--workers {self.workers} beside --dask", "one of them: the cluster has workers"
            )

    def finished(self, work: Callable[[_Job], _Result], jobs: Sequence[_Job]) -> Iterator[_Result]:
        """Do all jobs; results come as they are finished, in any order.

        Whoever stops listening cancels the jobs that have not begun. ``work`` is a function of a
        module, which a job and its result can be sent to and from.

        Raises
        ------
        ConfigError
            If the scheduler cannot be reached.
        """
        if not jobs:
            return
        if self.workers == 1 and self.dask is None:
            yield from map(work, jobs)
            return
        pool = _local_executor(self.workers) if self.dask is None else _dask_executor(self.dask)
        with pool as executor:
            futures = {executor.submit(work, job) for job in jobs}
            try:
                while futures:
                    # a signal that another thread took is handled when this wait ends
                    done, futures = wait(futures, _SIGNALS_S, FIRST_COMPLETED)
                    yield from map(_result, done)
            finally:
                if self.dask is not None:  # a pool of this machine ends its workers by itself
                    for future in futures:
                        future.cancel()


@contextmanager
def _local_executor(workers: int) -> Iterator[Executor]:
    context = multiprocessing.get_context("spawn")
    with ProcessPoolExecutor(workers, context, initializer=_prepare_worker) as executor:
        try:
            yield executor
        except BaseException:  # such as a signal to end: nobody waits for the jobs that run
            for worker in multiprocessing.active_children():
                worker.terminate()
            raise


def _prepare_worker() -> None:
    """End this worker at Ctrl-C, and when its parent ends: it would wait for ever otherwise."""
    signal.signal(signal.SIGINT, signal.SIG_DFL)
    end_worker_with_parent()


def _result(future: Future[_Result]) -> _Result:
    """What a worker made of a job; ConfigError if it was killed, or ran out of memory."""
    try:
        return future.result()
    except Exception as error:
        if type(error).__name__ not in _LOST_WORKERS:
            raise
        raise ConfigError(
            f"a worker ended by itself ({type(error).__name__})",
            "memory and time for every worker",
            "--resume goes on with fewer --workers",
        ) from error


@contextmanager
def _dask_executor(address: str) -> Iterator[Executor]:
    try:
        distributed: Any = importlib.import_module("distributed")
    except ImportError as error:
        raise ConfigError(
            "--dask needs dask.distributed, which is not installed", "pip install 'dfvs-lab[dask]'"
        ) from error
    try:
        client = distributed.Client(address, set_as_default=False)
    except (OSError, TimeoutError, ValueError) as error:
        raise ConfigError(
            f"--dask {address}: no scheduler answers ({error})",
            "the address that dask scheduler printed, such as tcp://127.0.0.1:8786",
        ) from error
    with client, client.get_executor(pure=False) as executor:
        yield executor
