"""An autopilot that is watched as the gate does, for as long as a test lasts."""

import contextlib
import threading

_KEPT = []
"""Their native side lives on: a reading that has begun may end after its test."""


class _EndedError(Exception):
    """The test is over."""


@contextlib.contextmanager
def watched_autopilot(autopilot, on_device_lost):
    """Watch a connected autopilot; the thread ends with its next turn after the context."""

    def watch():
        with contextlib.suppress(_EndedError):
            autopilot.watch(on_device_lost)

    def end():
        raise _EndedError

    _KEPT.append(autopilot)
    threading.Thread(target=watch, daemon=True).start()
    try:
        yield autopilot
    finally:
        autopilot.receive_from_others = end
