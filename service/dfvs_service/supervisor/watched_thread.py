"""Threads that report a failure and restart their work once."""

import logging
import threading
from collections.abc import Callable

RESTARTS = 1

log = logging.getLogger("dfvs.threads")


def run_watched(
    name: str,
    work: Callable[[], None],
    report: Callable[[str], None],
    on_end: Callable[[str], None] | None = None,
) -> None:
    """Do some work until it returns; whatever it raises is reported, and it is started once more.

    ``report`` takes one line about each failure, and must not block. ``on_end`` takes the line
    about the failure after which the work is given up.
    """
    for attempt in range(RESTARTS + 1):
        try:
            work()
        except Exception as error:
            log.exception("thread %s failed", name)
            is_last = attempt == RESTARTS
            follows = "it has ended" if is_last else "it is started once more"
            line = f"the thread {name!r} failed ({error!r:.80}); {follows}"
            report(line)
            if is_last and on_end is not None:
                on_end(line)
        else:
            return


def start_watched(
    name: str, work: Callable[[], None], report: Callable[[str], None]
) -> threading.Thread:
    """Start a daemon thread that does some work under :func:`run_watched`."""
    thread = threading.Thread(target=run_watched, args=(name, work, report), name=name, daemon=True)
    thread.start()
    return thread
