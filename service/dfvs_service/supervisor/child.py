"""Child process with a parent-watchdog pipe and an error file."""

import contextlib
import os
import subprocess
import sys
import time
from collections.abc import Sequence
from pathlib import Path

from dfvs_common.child import describe_end, start_child
from dfvs_common.lifecycle import EXIT_FAILED, ONE_BLAS_THREAD

LEAST_END_S = 0.15
_KILLED_END_S = 0.8
_TAIL_BYTES = 4096

STEADY_HEAP = {
    "MALLOC_ARENA_MAX": "1",
    "MALLOC_MMAP_THRESHOLD_": str(32 << 20),
    "MALLOC_TRIM_THRESHOLD_": str(256 << 20),
    "NUMPY_MADVISE_HUGEPAGE": "0",
}
"""glibc's limits, fixed: left alone they follow the largest block that was freed so far.

Arrays then move between heap and mappings whenever a larger image came by, and the heap was seen
to grow in steps. NumPy asks for huge pages where an array has 4 MB: the kernel then makes some of
the heap resident whole, whenever it comes by. There is one heap for all threads, and what it took
once is kept, see ``dfvs_service.perception.preallocation``.
"""


def use_one_blas_thread(module: str) -> None:
    """Run this process anew as ``python -P -m module`` where BLAS may use more threads.

    BLAS adds in another order on more threads, and reads their number at its start.
    """
    if not ONE_BLAS_THREAD.items() <= os.environ.items():
        words = [sys.executable, "-P", "-m", module, *sys.argv[1:]]
        os.execve(sys.executable, words, os.environ | ONE_BLAS_THREAD)


def new_lines(path: Path, begin: int) -> bytes:
    """Whole lines of a file from the byte ``begin`` on."""
    with path.open("rb") as file:
        file.seek(begin)
        data = file.read()
    return data[: data.rfind(b"\n") + 1]


class Child:
    """One of the service's processes, which ends with this one.

    Its standard input is a pipe: bytes mean that the parent lives, the end that it is gone. Its
    standard error is a file and not a pipe, since a parent that does not read a pipe would in
    the end block the child.
    """

    def __init__(self, command: Sequence[str], stderr: Path) -> None:
        self._stderr = stderr
        self._read = 0
        with stderr.open("wb") as errors:
            self._process = start_child(
                command, subprocess.DEVNULL, errors, subprocess.PIPE, STEADY_HEAP
            )
        if self._process.stdin is None:
            raise RuntimeError("the child has no standard input")
        self._pipe = self._process.stdin.fileno()
        os.set_blocking(self._pipe, False)

    @property
    def code(self) -> int | None:
        """Exit code (negative: killed by that signal), None while it runs."""
        return self._process.poll()

    @property
    def ending(self) -> str:
        """How it ended, in words: with the last line of its standard error where it failed."""
        code = self.code
        if code != EXIT_FAILED:
            return describe_end(code)
        with self._stderr.open("rb") as file:
            file.seek(max(file.seek(0, os.SEEK_END) - _TAIL_BYTES, 0))
            *_, last = ["", *file.read().decode(errors="replace").splitlines()]
        return f"{describe_end(code)} ({last})" if last else describe_end(code)

    def ping(self) -> None:
        """Show that the parent lives."""
        with contextlib.suppress(BlockingIOError, BrokenPipeError):
            os.write(self._pipe, b".")

    def terminate(self) -> None:
        """Ask it to end."""
        self._process.terminate()

    def kill(self) -> None:
        """End it at once, also when it is stopped or hung."""
        self._process.kill()

    def wait(self, timeout_s: float) -> bool:
        """Wait for its end; returns whether it ended."""
        with contextlib.suppress(subprocess.TimeoutExpired):
            self._process.wait(timeout_s)
        return self.code is not None

    def end_by(self, until_s: float) -> None:
        """End it in an orderly way, or by force after that time (monotonic)."""
        if self.code is None:
            self.terminate()
        if not self.wait(max(until_s - time.monotonic(), LEAST_END_S)):
            self.kill()
            self.wait(_KILLED_END_S)

    def new_errors(self) -> list[str]:
        """Whole lines that it wrote to its standard error since the last call."""
        lines = new_lines(self._stderr, self._read)
        self._read += len(lines)
        return lines.decode(errors="replace").splitlines()
