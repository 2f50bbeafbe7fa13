"""The mounting's check on its way to the gate: from attitude and images to the report."""

import numpy as np
import pytest
from box_flight import STATE_S, BoxFlight

from dfvs_core.messages.goal import Mount

START_M = (-0.8, 0.2, 0.1)
RIGHT_SCORE = 5.0
"""Standard deviations from which on the gate takes the mounting for right, or for wrong."""


def score_reported(mounted_deg, velocity, seconds=2.5):
    """What is reported of a vehicle that hovers for a second and then moves in strides.

    The settings say that the camera looks ahead; it is mounted ``mounted_deg`` further round.
    """
    flight = BoxFlight(START_M, Mount(yaw_rad=np.radians(mounted_deg)))
    for k in range(round(seconds / STATE_S)):
        strides = k * STATE_S > 1.0 and k * STATE_S % 1.0 < 0.5
        flight.step(velocity if strides else (0.0, 0.0, 0.0), error=(0.0, 0.0, 0.0))
    return flight.looks[-1].outcome.report.mounting_score


@pytest.mark.parametrize(
    ("velocity", "is_about_both_axes"),
    [((0.1, 0.0, 0.0), False), ((0.0, -0.1, 0.0), False), ((0.07, 0.07, 0.05), True)],
    ids=["on", "left", "diagonal"],
)
def test_the_report_tells_how_the_camera_is_mounted(velocity, is_about_both_axes):
    """The vehicle tilts to set out and to stop, as it does while its mounting is undecided.

    A tilt about one axis tells a camera that is turned about the vertical, and clears none.
    """
    assert (score_reported(0.0, velocity) > RIGHT_SCORE) == is_about_both_axes
    for mounted_deg in (180.0, 90.0, -90.0):
        assert score_reported(mounted_deg, velocity) < -RIGHT_SCORE


def test_a_vehicle_that_does_not_tilt_reports_that_nothing_is_known():
    for mounted_deg in (0.0, 180.0):
        assert score_reported(mounted_deg, (0.0, 0.0, 0.0), 4.0) is None
