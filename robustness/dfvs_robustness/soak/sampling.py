"""Memory, descriptors and threads of the service's processes, every few seconds."""

import threading
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import psutil

PERIOD_S = 2.0
_OWN = ("RssAnon:", "RssShmem:")
_ROLES = {
    "dfvs_service.gate": "gate",
    "dfvs_service.perception": "perception",
    "dfvs_service.operator_link": "operator link",
    "dfvs_service.flights": "black box",
    "dfvs_service.record": "recorder",
}


@dataclass(frozen=True, slots=True)
class Sample:
    """One process at one moment; memory in MB, latency in ms (None where it was not told).

    ``own_mb`` leaves out pages of files: the kernel drops them, and other processes that map the
    same libraries come and go.
    """

    t_s: float
    role: str
    pid: int
    rss_mb: float
    own_mb: float
    descriptors: int
    threads: int
    cpu_percent: float
    latency_p50_ms: float | None = None
    latency_p99_ms: float | None = None


class Sampler:
    """Samples a process and its children on a thread of its own.

    ``latency_ms`` gives p50 and p99 of perception's newest latencies, None where nothing is known.
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
            return Sample(
                t_s=round(t_s, 2),
                role=role,
                pid=process.pid,
                rss_mb=process.memory_info().rss / 1e6,
                own_mb=own_memory_mb(process.pid),
                descriptors=process.num_fds(),
                threads=process.num_threads(),
                cpu_percent=process.cpu_percent(),
                latency_p50_ms=None if latency is None else latency[0],
                latency_p99_ms=None if latency is None else latency[1],
            )


def own_memory_mb(pid: int) -> float:
    """Resident memory of a process that no file stands behind, MB.

    Raises
    ------
    psutil.NoSuchProcess
        If the process has ended.
    """
    try:
        lines = Path(f"/proc/{pid}/status").read_text(encoding="utf-8").splitlines()
    except (FileNotFoundError, ProcessLookupError) as error:
        raise psutil.NoSuchProcess(pid) from error
    return sum(int(line.split()[1]) for line in lines if line.startswith(_OWN)) * 1024 / 1e6


def role_of(words: list[str]) -> str:
    """Role of a process by its command line; parent where no module of another is in it."""
    for word in words:
        for module, role in _ROLES.items():
            if word == module or word.startswith(f"{module}."):
                return role
    return "parent"
