"""Which part of a flight its figures are of."""

from typing import Any

import numpy as np

from dfvs_sim.demo.flight.flight import FlightLog
from dfvs_sim.demo.flight.track import Track, TrackPoint

S = 10**9


def test_it_is_judged_up_to_a_second_after_its_end():
    """From then on the pilot flies."""
    unused: Any = None
    track = Track(unused, np.eye(4))
    track.points = [TrackPoint(k * S // 10, np.eye(4), 0.01 * k, 0.0) for k in range(100)]
    log = FlightLog(unused, unused, track, unused, 2 * S, 5 * S, "DONE", "goal reached", None)
    assert [point.t_ns for point in log.judged][:: len(log.judged) - 1] == [2 * S, 6 * S]
