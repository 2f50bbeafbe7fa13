"""What of the servo's memory is taken over to another goal."""

import numpy as np
import pytest

from dfvs_core.depth.depth_map import DepthMap
from dfvs_core.servo.exchange import ServoState
from dfvs_core.servo.goal_filter import FilterModel, PositionMeasurement, begin
from dfvs_core.servo.points import LEAST_POINTS

ESTIMATE = begin(PositionMeasurement(np.array([0.0, 0.0, 1.0]), 3.0, 0.0), FilterModel())


def with_depth(measured):
    """Memory whose depth map has so many measured points of 5 x 10."""
    validity = np.zeros(50, np.float32)
    validity[:measured] = 1.0
    depth_map = DepthMap(np.full((5, 10), 3.0, np.float32), validity.reshape(5, 10))
    return ServoState(depth_map=depth_map, depth_ns=7, estimate=ESTIMATE)


@pytest.mark.parametrize(
    ("measured", "kept"), [(LEAST_POINTS, True), (LEAST_POINTS - 1, False), (0, False)]
)
def test_another_goal_takes_over_the_scale_of_a_measured_depth_alone(measured, kept):
    before = with_depth(measured)
    after = before.without_goal()
    assert (after.estimate is ESTIMATE) == kept
    assert (after.depth_map, after.depth_ns) == (before.depth_map, before.depth_ns)


def test_without_any_depth_there_is_no_scale_to_take_over():
    assert ServoState(estimate=ESTIMATE).without_goal().estimate is None


def test_another_goal_does_not_take_over_a_tilt_error_against_the_former_one():
    assert ServoState(attitude_error_rad=(0.02, 0.05)).without_goal().attitude_error_rad == (0, 0)
