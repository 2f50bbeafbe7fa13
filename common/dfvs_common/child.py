"""Child processes, which end with this one."""

import contextlib
import multiprocessing
import os
import signal
import subprocess
import sys
import time
from collections.abc import Mapping, Sequence
from pathlib import Path
from types import TracebackType
from typing import IO, Any, Self

from dfvs_common.lifecycle import ONE_BLAS_THREAD, child_environment, end_with_parent

_GRACE_S = 4.0
_TAIL_LINES = 6


def start_child(
    command: Sequence[str],
    stdout: int | IO[bytes] | None,
    stderr: int | IO[bytes] | None,
    stdin: int = subprocess.DEVNULL,
    environment: Mapping[str, str] | None = None,
) -> subprocess.Popen[bytes]:
    """Start a process that ends with this one and uses one BLAS thread.

    It has to call :func:`end_with_parent`, as :func:`run_command` does.

    Parameters
    ----------
    command : sequence of str
        Program and its arguments.
    stdout, stderr, stdin
        As ``subprocess.Popen`` takes them.
    environment : mapping, optional
        Further variables; those of this process count before them.
    """
    variables = {**(environment or {}), **os.environ, **ONE_BLAS_THREAD, **child_environment()}
    return subprocess.Popen(command, stdin=stdin, stdout=stdout, stderr=stderr, env=variables)


def describe_end(code: int | None) -> str:
    """How a process with that exit code ended, in words; negative: by that signal."""
    if code is not None and code < 0:
        return f"was killed by {signal.Signals(-code).name}"
    return f"ended with code {code}"


def end_all(processes: Sequence[subprocess.Popen[Any]], grace_s: float) -> None:
    """End what still runs: SIGTERM to all, and SIGKILL to those that run on after the grace."""
    for process in processes:
        if process.poll() is None:
            process.terminate()
    deadline = time.monotonic() + grace_s
    for process in processes:
        try:
            process.wait(max(deadline - time.monotonic(), 0.0))
        except subprocess.TimeoutExpired:
            process.kill()
            process.wait()


def end_worker_with_parent() -> None:
    """Have a worker process of ``multiprocessing`` end when its parent is gone."""
    parent = multiprocessing.parent_process()
    if parent is not None:
        end_with_parent(parent.pid)


class Child:
    """One Python module run as a process; leaving the context ends it.

    Parameters
    ----------
    name : str
        For messages and the log file.
    arguments : list of str
        After ``python -m``: module and its arguments.
    log : Path, optional
        Takes what the process prints, which otherwise goes where this one prints.
    """

    def __init__(self, name: str, arguments: list[str], log: Path | None = None) -> None:
        self.name = name
        self.log = log
        self._command = [sys.executable, "-m", *arguments]
        self._process: subprocess.Popen[bytes] | None = None

    def __enter__(self) -> Self:
        """Start it."""
        with contextlib.ExitStack() as stack:
            output = None if self.log is None else stack.enter_context(self.log.open("wb"))
            self._process = start_child(self._command, output, output)
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        """End it: SIGTERM, and SIGKILL where that does not help."""
        if self._process is not None:
            end_all([self._process], _GRACE_S)

    @property
    def pid(self) -> int:
        """Process id, 0 before it was started."""
        return 0 if self._process is None else self._process.pid

    @property
    def exit_code(self) -> int | None:
        """Exit code, or None while it runs."""
        return None if self._process is None else self._process.poll()

    def wait(self, timeout_s: float) -> int | None:
        """Exit code, waiting for it at most so long."""
        if self._process is None:
            return None
        try:
            return self._process.wait(timeout_s)
        except subprocess.TimeoutExpired:
            return None

    def last_lines(self) -> str:
        """End of what it printed."""
        if self.log is None:
            return ""
        lines = self.log.read_text(encoding="utf-8", errors="replace").strip().splitlines()
        return "\n".join(lines[-_TAIL_LINES:])
