"""Faults of processes, processor, disk and network."""

import contextlib
import os
import resource
import signal
import time

import numpy as np

from dfvs_robustness.faults.fault import Inject
from dfvs_robustness.harness.harness import Harness
from dfvs_robustness.harness.load import busy_cores

_HOGS = 2
"""Busy processes for every core."""
_HOG_S, _THROTTLE_S = 2.0, 1.5
_RUN_S, _REST_S = 0.03, 0.3


def _signals(name: str, number: signal.Signals) -> Inject:
    """Send a signal to one of the service's processes.

    For perception the last good frame before it counts.
    """

    def inject(harness: Harness, _: np.random.Generator) -> int:
        pid = harness.service.pid(name)
        now_ns = time.monotonic_ns()
        if name == "gate":
            harness.disturbed_ns = now_ns
        os.kill(pid, number)
        return harness.camera.last_good_ns if name == "perception" else now_ns

    return inject


def _starve(harness: Harness, _: np.random.Generator) -> int:
    """Keep every core busy twice over, for two seconds."""
    t_ns = time.monotonic_ns()
    with busy_cores(_HOGS, _HOG_S) as hogs:
        for hog in hogs:
            hog.wait()
    return t_ns


def _throttle(harness: Harness, _: np.random.Generator) -> int:
    """Let perception run a tenth of the time, as on a processor that is too hot."""
    pid = harness.service.pid("perception")
    end = time.monotonic() + _THROTTLE_S
    t0_ns = harness.camera.last_good_ns
    with contextlib.suppress(ProcessLookupError):
        while time.monotonic() < end:
            os.kill(pid, signal.SIGSTOP)
            time.sleep(_REST_S)
            os.kill(pid, signal.SIGCONT)
            time.sleep(_RUN_S)
    return t0_ns


def _fill_disk(harness: Harness, _: np.random.Generator) -> int:
    """Let no file of the gate grow any more."""
    pid = harness.service.pid("gate")
    resource.prlimit(pid, resource.RLIMIT_FSIZE, (0, 0))
    return time.monotonic_ns()


def _kill_router(harness: Harness, _: np.random.Generator) -> int:
    harness.stop_router()
    return harness.camera.last_good_ns


PROCESS_FAULTS: dict[str, Inject] = {
    "gate-dies": _signals("gate", signal.SIGKILL),
    "gate-hangs": _signals("gate", signal.SIGSTOP),
    "perception-dies": _signals("perception", signal.SIGKILL),
    "perception-hangs": _signals("perception", signal.SIGSTOP),
    "parent-dies": _signals("parent", signal.SIGKILL),
    "parent-hangs": _signals("parent", signal.SIGSTOP),
    "sigterm": _signals("parent", signal.SIGTERM),
    "cpu-starved": _starve,
    "throttled": _throttle,
    "disk-full": _fill_disk,
    "router-dies": _kill_router,
}
