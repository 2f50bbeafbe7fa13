"""Real-time priority of the gate and its parent."""

import contextlib
import os

NICE = -10


def prefer_this_process() -> None:
    """Ask the kernel to run this process before others; without the right to, change nothing.

    Both need little of the processor, but soon: perception may use up all of it. Rights come
    with systemd's ``Nice=`` or CAP_SYS_NICE.
    """
    with contextlib.suppress(PermissionError):
        os.setpriority(os.PRIO_PROCESS, 0, NICE)
