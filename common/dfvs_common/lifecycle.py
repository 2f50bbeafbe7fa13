"""Life of a process: its end by signals, and with the process that started it."""

import ctypes
import os
import signal
import sys
import threading
from collections.abc import Callable
from types import FrameType

from dfvs_common.progress import log
from dfvs_core.errors import DfvsError

EXIT_OK, EXIT_FAILED, EXIT_CANNOT_RUN = 0, 1, 2
"""Exit codes of every command: it ran; it ran without the wanted result; it cannot run."""

ENDING_SIGNALS = (signal.SIGTERM, signal.SIGINT, signal.SIGHUP)
"""Ask a process to end: a supervisor, the terminal's Ctrl-C, the closing of the terminal."""

ORPHANED = signal.SIGUSR1
"""Signal that the parent is gone, apart from SIGTERM."""

ONE_BLAS_THREAD = {"OPENBLAS_NUM_THREADS": "1", "OMP_NUM_THREADS": "1"}
"""Variables of a child process whose matrices are small: BLAS threads would only spin."""

_PARENT = "DFVS_PARENT_PID"
_PR_SET_PDEATHSIG = 1
_NICENESS = 10


def give_way_to_flights() -> None:
    """Lower this process's priority, for a command that may run beside a flight.

    A command's entry point calls it where it was started as a program, not where it was called.
    """
    os.nice(_NICENESS)


def child_environment() -> dict[str, str]:
    """Variables for a child process that calls :func:`end_with_parent`.

    ``python -m`` imports nothing from the folder in which the user stands.
    Linux ends the child with the *thread* that started it: start children on the main thread, or
    on one that lives longer than they do.
    """
    return {_PARENT: str(os.getpid()), "PYTHONSAFEPATH": "1"}


def end_with_parent(parent: int | None = None, number: signal.Signals = signal.SIGTERM) -> None:
    """Have the kernel send a signal to this process once its parent is gone, however it ended.

    Parameters
    ----------
    parent : int, optional
        Process id of the parent. By default that of :func:`child_environment`; without it nothing
        happens, so that a process that was started by hand may outlive its shell.
    number : signal.Signals
        The signal.
    """
    told = os.environ.pop(_PARENT, "")
    expected = parent if parent is not None else int(told) if told.isdecimal() else None
    if expected is None or sys.platform != "linux":
        return
    ctypes.CDLL(None, use_errno=True).prctl(_PR_SET_PDEATHSIG, int(number), 0, 0, 0)
    if os.getppid() != expected:  # it ended before
        os.kill(os.getpid(), number)


def handle_ending_signals(handler: Callable[[int, FrameType | None], None]) -> None:
    """Call ``handler`` at SIGTERM, SIGINT and SIGHUP; SIGHUP stays ignored under ``nohup``."""
    for number in ENDING_SIGNALS:
        if number is not signal.SIGHUP or signal.getsignal(number) is not signal.SIG_IGN:
            signal.signal(number, handler)


def stop_event() -> threading.Event:
    """Event that is set at SIGTERM, SIGINT and SIGHUP."""
    stop = threading.Event()
    handle_ending_signals(lambda *_: stop.set())
    return stop


def exit_on_signals() -> list[int]:
    """Raise SystemExit (code 128 + number) at the first signal to end; those after it are ignored.

    Contexts end what they started then. Returns a list that takes the signal's number.
    """
    received: list[int] = []

    def end(number: int, _frame: FrameType | None) -> None:
        for each in ENDING_SIGNALS:
            signal.signal(each, signal.SIG_IGN)
        received.append(number)
        raise SystemExit(128 + number)

    handle_ending_signals(end)
    return received


def cannot_run(error: object) -> int:
    """Print an error as one line; returns ``EXIT_CANNOT_RUN``."""
    log(f"error: {error}")
    return EXIT_CANNOT_RUN


def run_command(work: Callable[[], int]) -> int:
    """Run the work of a command line; returns its exit code, 2 where it cannot run.

    The signals of :data:`ENDING_SIGNALS` and the end of the parent end it in an orderly way; a
    ``DfvsError`` is printed as one line, and so is an ``OSError``, such as of a full disk.

    Raises
    ------
    SystemExit
        At a signal that the work does not handle itself.
    """
    end_with_parent()
    before = {number: signal.getsignal(number) for number in ENDING_SIGNALS}
    received = exit_on_signals()
    try:
        return work()
    except Exception as error:
        if received:  # a library made something else of SystemExit
            raise SystemExit(128 + received[0]) from error
        if isinstance(error, OSError):
            return cannot_run(_described(error))
        if not isinstance(error, DfvsError):
            raise
        return cannot_run(error)
    finally:
        if not received:
            for number, handler in before.items():
                signal.signal(number, handler)


def _described(error: OSError) -> str:
    where = f"{error.filename}: " if error.filename else ""
    return f"{where}{error.strerror or error}"
