"""Learning depth gives way to frames that come late, but not for ever."""

import numpy as np
import pytest
from still_pipeline import StillMatcher, pipeline

from dfvs_core.messages.frame import Frame
from dfvs_core.perception.pipeline import DEPTH_PERIOD_NS, PATIENCE_NS
from dfvs_core.perception.vehicle_history import Motion

MS = 1_000_000
PERIOD_NS = 50 * MS
SIZE = (120, 160)


def learnt_at_ms(late_ns, seconds=3.0, engaged_from=10**9, period_ns=PERIOD_NS):
    """Times of the frames after which depth was learnt, each processed so late.

    The vehicle goes aside all the time, and is engaged from that frame on.
    """
    rng = np.random.default_rng(0)
    picture = rng.integers(0, 255, (*SIZE, 3)).astype(np.uint8)
    matcher, now = StillMatcher(), [0]
    perception = pipeline(picture, matcher, lambda: now[0], depth="motion")
    times_ms = []
    for k in range(int(seconds * 1e9 / period_ns)):
        t_ns = 10**9 + k * period_ns
        now[0] = t_ns + late_ns
        aside = np.array([0.0, 0.02 * k, 0.0])
        motion = Motion(t_ns, 0.0, 0.0, 0.0, np.zeros(3), aside, 0.0)
        perception.process_frame(Frame(picture, t_ns, k), motion, engaged=k >= engaged_from)
        before = len(matcher.predictions)
        perception.work_between_frames()
        if len(matcher.predictions) > before:
            times_ms.append(t_ns // MS)
    return times_ms


@pytest.mark.parametrize(
    ("late_ns", "between_ns"),
    [
        (0, DEPTH_PERIOD_NS),
        (PERIOD_NS - 1, DEPTH_PERIOD_NS),
        (PERIOD_NS, PATIENCE_NS),
    ],
)
def test_depth_waits_while_frames_come_later_than_from_one_to_the_next(late_ns, between_ns):
    times_ms = learnt_at_ms(late_ns)
    assert len(times_ms) > 2
    assert set(np.diff(times_ms)) == {between_ns // MS}


@pytest.mark.parametrize(("late_ns", "is_put_off"), [(100 * MS - 1, False), (100 * MS, True)])
def test_where_frames_are_lost_an_old_one_is_late_though_the_next_is_not_there(late_ns, is_put_off):
    """Every second frame of a camera was overtaken: the time between two is no measure then."""
    times_ms = learnt_at_ms(late_ns, period_ns=200 * MS)
    assert len(times_ms) > 2
    assert (np.diff(times_ms).min() >= PATIENCE_NS // MS) == is_put_off


def test_depth_is_learnt_from_the_first_motion_on():
    """By images alone: there is nothing that a vehicle has to prove first."""
    assert learnt_at_ms(0, engaged_from=20) == learnt_at_ms(0)
