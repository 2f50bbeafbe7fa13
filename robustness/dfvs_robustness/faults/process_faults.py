"""Faults of processes, processor, disk and network."""

import contextlib
import os
import resource
import signal
import time

import numpy as np

from dfvs_core.gate.states import Cause, GateState
from dfvs_robustness.faults.fault import (
    ANY_ENGAGED,
    CAPTURE_MS,
    FLOWN,
    READY_OR_ENGAGED,
    Fault,
    Inject,
    Reaction,
    fault,
)
from dfvs_robustness.harness.harness import Harness
from dfvs_robustness.harness.load import busy_cores
from dfvs_robustness.harness.setup import Setup

S = GateState
_HOGS = 2
"""Busy processes for every core."""
_HOG_S, _THROTTLE_S = 2.0, 1.5
_RUN_S, _REST_S = 0.03, 0.3
ROUTER = Setup(via_router=True)


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


def process_faults() -> tuple[Fault, ...]:
    """Faults of the machine, by the rows of the table."""
    hold, abort, silence = Reaction.HOLD, Reaction.ABORT, Reaction.SILENCE
    kill, stop = signal.SIGKILL, signal.SIGSTOP
    return (
        fault(
            ("gate-dies", "gate killed", "exit"),
            (silence, 100.0, READY_OR_ENGAGED, _signals("gate", kill)),
            restarts=True,
        ),
        fault(
            ("gate-hangs", "gate stopped", "parent's watch, 0.3 s"),
            (silence, 400.0, READY_OR_ENGAGED, _signals("gate", stop)),
            restarts=True,
        ),
        fault(
            ("perception-dies", "perception killed", "frame age"),
            (hold, CAPTURE_MS, ANY_ENGAGED, _signals("perception", kill)),
            restarts=True,
            says=(Cause.FRAME_OLD,),
        ),
        fault(
            ("perception-hangs", "perception stopped", "frame age"),
            (abort, 3700.0, (S.SERVO,), _signals("perception", stop)),
            restarts=True,
            says=(Cause.HOLD_TOO_LONG,),
        ),
        fault(
            ("parent-dies", "parent killed", "its pipe ends"),
            (abort, 300.0, ANY_ENGAGED, _signals("parent", kill)),
            restarts=True,
            says=(Cause.UNSUPERVISED,),
        ),
        fault(
            ("parent-hangs", "parent stopped", "no sign of life for 1 s"),
            (abort, 1400.0, ANY_ENGAGED, _signals("parent", stop)),
            restarts=True,
            says=(Cause.UNSUPERVISED,),
        ),
        fault(
            ("sigterm", "SIGTERM", "handler"),
            (Reaction.EXIT, 2000.0, READY_OR_ENGAGED, _signals("parent", signal.SIGTERM)),
            restarts=True,
            says=(Cause.STOPPED,),
        ),
        fault(
            ("cpu-starved", "two busy processes a core for 2 s", "missed deadlines"),
            (Reaction.STREAM, 150.0, FLOWN, _starve),
            alone=True,
        ),
        fault(
            ("throttled", "perception gets a tenth of its time", "frame age"),
            (hold, CAPTURE_MS, FLOWN, _throttle),
            says=(Cause.FRAME_OLD,),
        ),
        fault(
            ("disk-full", "no file can grow", "bounded queue"),
            (Reaction.STREAM, 150.0, FLOWN, _fill_disk),
            watch_s=1.0,
            restarts=True,
        ),
        fault(
            ("router-dies", "Zenoh router dies", "silence, frame age"),
            (hold, CAPTURE_MS, READY_OR_ENGAGED, _kill_router),
            ROUTER,
            says=("no camera frame",),
        ),
    )
