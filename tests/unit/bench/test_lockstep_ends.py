"""How simulated flights that did not reach the goal are reported."""

import numpy as np

from dfvs_bench.lockstep.flight import LockstepLog, Sample
from dfvs_bench.lockstep.record import simulated_flight, summarise


def test_a_flight_that_never_engaged_ends_in_the_state_in_which_it_waited():
    waiting = Sample(0.0, "PREFLIGHT", 1.0, 0.2, np.eye(4), None)
    never = simulated_flight(3, np.eye(4), LockstepLog([waiting, waiting]))
    assert (never.seed, never.end_state, never.end_cause, never.end_s) == (3, "PREFLIGHT", "", None)
    assert never.start_m is None
    summary = summarise([never])
    assert (summary["done"], summary["other_ends"]) == (0, [])
