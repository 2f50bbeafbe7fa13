"""Load of the processor beside what is measured, and who comes first."""

import os
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager, suppress


@contextmanager
def busy_cores(per_core: int, seconds: float) -> Iterator[list[subprocess.Popen[bytes]]]:
    """Busy processes that end by themselves after so many seconds, or with the context."""
    code = f"import time\nend = time.monotonic() + {seconds}\nwhile time.monotonic() < end: pass"
    count = per_core * (os.cpu_count() or 1)
    busy = [subprocess.Popen([sys.executable, "-S", "-c", code]) for _ in range(count)]
    try:
        yield busy
    finally:
        for process in busy:
            process.kill()
            process.wait()


def take_precedence() -> None:
    """Run before others, where that is allowed: what measures must not be late itself.

    The service's own processes start at 0 again.
    """
    with suppress(PermissionError):
        os.setpriority(os.PRIO_PROCESS, 0, -5)
