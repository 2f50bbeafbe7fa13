"""The late camera answers as the vehicle does whose step responses were recorded."""

import numpy as np
import pytest

from dfvs_bench.methods.dfvs import LateDrive
from dfvs_bench.methods.method import FRAME_PERIOD_S


def step_response(seconds):
    drive = LateDrive()
    twists = [drive(np.full(6, 0.5)) for _ in range(round(seconds / FRAME_PERIOD_S))]
    return np.array(twists) / 0.5


def test_a_step_is_followed_as_late_as_by_the_vehicle():
    share = step_response(5.0)[:, 0]
    times_s = (np.arange(len(share)) + 0.5) * FRAME_PERIOD_S
    assert np.interp(0.10, share, times_s) == pytest.approx(0.27, abs=0.05)
    assert np.interp(0.63, share, times_s) == pytest.approx(0.95, abs=0.1)


def test_what_is_asked_for_is_made_in_the_end_and_late_by_the_response():
    made = step_response(20.0)
    assert made[-1] == pytest.approx(np.ones(6), abs=1e-6)
    missing_s = (1.0 - made[:, 3]).sum() * FRAME_PERIOD_S
    assert missing_s == pytest.approx(LateDrive.RESPONSE_S, abs=5e-3)
