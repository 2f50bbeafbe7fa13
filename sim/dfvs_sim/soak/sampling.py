"""Memory, descriptors and threads of the service's processes, every few seconds."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from dataclasses import dataclass

import psutil

PERIOD_S = 2.0
_ROLES = {"dfvs_service.gate": "gate", "dfvs_service.perception": "perception"}


@dataclass(frozen=True, slots=True)
class Sample:
    """One process at one moment; memory in MB, latency in ms (None where it was not told)."""

    t_s: float
    role: str
    pid: int
    rss_mb: float
    pss_mb: float
    descriptors: int
    threads: int
    cpu_percent: float
    latency_p50_ms: float | None = None
    latency_p99_ms: float | None = None


class Sampler:
    """Samples a process and its children on a thread of its own.

    Parameters
    ----------
    pid : int
        Of the process that started the others.
    latency_ms : callable
        Gives p50 and p99 of perception's newest latencies, None where nothing is known.
    """

    def __init__(self, pid: int, latency_ms: Callable[[], tuple[float, float] | None]) -> None:
        self.samples: list[Sample] = []
        self._parent = psutil.Process(pid)
        self._known: dict[int, psutil.Process] = {}
        self._latency_ms = latency_ms
        self._began_s = time.monotonic()

    def run(self, stop: threading.Event) -> None:
        """Sample until stopped, or until the process ends."""
        while not stop.wait(PERIOD_S):
            try:
                self.sample()
            except psutil.NoSuchProcess:
                return

    def sample(self) -> None:
        """Take one sample of every process.

        Raises
        ------
        psutil.NoSuchProcess
            If one of them has ended.
        """
        t_s = time.monotonic() - self._began_s
        for process in (self._parent, *self._parent.children(recursive=True)):
            known = self._known.setdefault(process.pid, process)
            self.samples.append(self._look(known, t_s))

    def _look(self, process: psutil.Process, t_s: float) -> Sample:
        with process.oneshot():
            role = role_of(process.cmdline())
            latency = self._latency_ms() if role == "perception" else None
            memory = process.memory_full_info()
            return Sample(
                t_s=round(t_s, 2),
                role=role,
                pid=process.pid,
                rss_mb=memory.rss / 1e6,
                pss_mb=memory.pss / 1e6,
                descriptors=process.num_fds(),
                threads=process.num_threads(),
                cpu_percent=process.cpu_percent(),
                latency_p50_ms=None if latency is None else latency[0],
                latency_p99_ms=None if latency is None else latency[1],
            )


def role_of(words: list[str]) -> str:
    """Role of a process by its command line: gate, perception, or else parent."""
    for word in words:
        for module, role in _ROLES.items():
            if word == module or word.startswith(f"{module}."):
                return role
    return "parent"
