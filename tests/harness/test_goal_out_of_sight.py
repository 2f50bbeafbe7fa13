"""What the servo keeps of depth and scale while the goal is not seen."""

import math

import numpy as np
from box_flight import ROOM, STATE_S, BoxFlight

from dfvs_core.messages.goal import Mount

EXACT = (0.0, 0.0, 0.0)
FAR_WALL_M, NEAR_WALL_M = (-2.5, 0.0, 0.0), (3.2, 0.0, 0.0)
"""Goals, 6.5 and 0.8 m before the wall that they look at."""


def flies(flight, seconds, velocity_m_s=None):
    """Fly at a velocity, or at what perception asks for."""
    for _ in range(round(seconds / STATE_S)):
        asked = flight.looks[-1].outcome.result.velocity[:3] if flight.looks else EXACT
        flight.step(asked if velocity_m_s is None else velocity_m_s, EXACT)


def median_px(flow, other):
    """Median distance of two flows where both are known, px."""
    known = (flow.confidence > 0) & (other.confidence > 0)
    return float(np.median(np.linalg.norm((flow.flow - other.flow)[known], axis=1)))


def test_a_goal_at_another_place_begins_with_an_open_scale():
    """A pilot flies there, while neither goal is seen: the depth that the scale was of is gone."""
    flight = BoxFlight((-3.4, 0.9, 0.3))
    flight.go_on(FAR_WALL_M)
    flies(flight, 6.0)
    assert flight.state.estimate.scale_spread < 0.2
    flight.matcher.is_blind = True
    flies(flight, 11.0, (0.5, -0.03, 0.0))
    flight.go_on(NEAR_WALL_M)
    flies(flight, 0.4, EXACT)
    flight.matcher.is_blind = False
    flies(flight, 0.2, EXACT)
    assert flight.state.estimate.scale_spread > 0.5
    flies(flight, 2.0)
    look = flight.looks[-1]
    assert abs(math.log(look.ratio)) < 2.5 * look.outcome.result.uncertainty.scale


def test_a_frame_without_the_goal_leaves_the_depth_that_the_next_one_is_predicted_by():
    flight = BoxFlight((-2.5, 0.4, 0.2))
    flies(flight, 6.0, (0.3, -0.05, -0.02))
    flight.matcher.is_blind = True
    flies(flight, 3 * STATE_S, (0.3, 0.9, -0.02))
    assert flight.looks[-1].outcome.result.status.name == "NO_OVERLAP"
    flight.matcher.predicted.clear()
    flies(flight, 3 * STATE_S, (0.3, 0.9, -0.02))
    true = ROOM.flow(flight.matcher.T_world_camera, Mount().T_body_camera())
    assert min(median_px(flow, true) for flow in flight.matcher.predicted) < 2.0
