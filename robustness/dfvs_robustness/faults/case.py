"""A case: one fault in one state of the gate with one seed, and what came of it."""

import time
import zlib

import numpy as np

from dfvs_core.gate.states import GateState
from dfvs_robustness.faults.fault import UNFIT, Fault, Outcome, Reaction
from dfvs_robustness.faults.judging import MS, Oracle, judge
from dfvs_robustness.harness.harness import Harness
from dfvs_robustness.harness.service import HarnessError, wait_until
from dfvs_robustness.harness.state_setup import reach_state

S = GateState

_SETTLE_S = 0.3
_SHORT_SETTLE_S, _SHORT_SHARE = 0.1, 0.5
"""READY is left after half a second of failing checks; every other fault there is shorter."""
_READY_LEFT_S = 2.5
"""Faults in READY that are not short must lead to PREFLIGHT by then, some by the frame rate."""
_PHASE_S = 0.2
"""Faults come at any phase of frames (0.07 s) and of telemetry (0.05 s)."""
_LATE_S = 3.0
"""Over the limit a case is watched for so long, to tell late from never."""


def run_case(harness: Harness, fault: Fault, state: GateState, seed: int) -> Outcome:
    """Bring the gate to the state, let the fault happen, and judge.

    Raises
    ------
    HarnessError
        If the state cannot be reached, or the machine was too busy for a verdict.
    """
    rng = np.random.default_rng([seed, zlib.crc32(fault.name.encode()), list(S).index(state)])
    harness.places = rng
    reach_state(harness, state)
    time.sleep(float(rng.uniform(0.0, _PHASE_S)))
    if harness.state is not state:
        raise HarnessError(f"the gate went to {harness.state} before the fault")
    begin_ns = harness.environment.note("fault", name=fault.name, state=str(state), seed=seed)
    t0_ns = fault.inject(harness, rng)
    must_leave = is_short = False
    if state is S.READY and fault.reaction in UNFIT:
        is_short = fault.reaction is Reaction.HOLD and bool(rng.random() < _SHORT_SHARE)
        must_leave = not is_short
    if must_leave:
        wait_until(lambda: harness.state is S.PREFLIGHT, _READY_LEFT_S)
    over_ns = _watch(harness, fault, state, _SHORT_SETTLE_S if is_short else _SETTLE_S)
    if t0_ns is None:
        t0_ns = harness.camera.last_good_ns
    oracle = Oracle.collect(harness, begin_ns, over_ns, must_leave=must_leave)
    if fault.spares_frames and oracle.was_late():
        raise HarnessError("frames were late by themselves: the machine is too busy")
    outcome = judge(fault, state, seed, t0_ns, oracle)
    if not outcome.passed and oracle.environment_late_ns:
        raise HarnessError(f"the vehicle stood still for {oracle.environment_late_ns / MS:.0f} ms")
    return outcome


def _watch(harness: Harness, fault: Fault, state: GateState, settle_s: float) -> int:
    """Wait until the reaction has come, or cannot come in time any more; when that was."""
    limit_s = fault.limit_ms / 1000 + _LATE_S
    ends = {
        Reaction.ABORT: lambda: harness.state is S.ABORT,
        Reaction.RELEASED: lambda: harness.state is S.RELEASED,
        Reaction.ENDED: lambda: harness.state in (S.ABORT, S.RELEASED),
        Reaction.EXIT: lambda: not harness.service.is_running(),
        Reaction.SILENCE: lambda: not harness.service.is_running(),
    }
    nothing_flies = fault.reaction in UNFIT and state is S.READY
    if fault.reaction in ends and not nothing_flies:
        wait_until(ends[fault.reaction], limit_s)
        over_ns = time.monotonic_ns()
        time.sleep(_SETTLE_S)
        return over_ns
    time.sleep(max(fault.watch_s, fault.limit_ms / 1000 + settle_s))
    return time.monotonic_ns()
