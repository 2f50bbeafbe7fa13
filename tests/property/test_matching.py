"""Properties of matching on random motions of a textured wall."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from textured_wall import Wall, errors, exact_flow, inside, texture, turned

from dfvs_core.matching.classical import classical_matcher

MATCHER = classical_matcher()
WALL = Wall(texture(np.random.default_rng(21)))
MOTIONS = st.builds(
    turned,
    roll_deg=st.floats(-40, 40),
    zoom=st.floats(0.75, 1.35),
    shift=st.tuples(st.floats(-50, 50), st.floats(-40, 40)),
    perspective=st.tuples(st.floats(-5e-4, 5e-4), st.floats(-5e-4, 5e-4)),
)
REPEATS = 12  # a match takes a third of a second


@pytest.fixture(scope="module")
def goal():
    return MATCHER.encode(WALL.picture())


@settings(max_examples=REPEATS)
@given(H=MOTIONS)
def test_any_motion_in_reach_is_recovered(goal, H):
    truth = exact_flow(H)
    field = MATCHER.match(goal, MATCHER.encode(WALL.picture(H)))
    visible = inside(truth, margin=8.0)
    assert np.mean(errors(field, truth)[visible] < 1.0) > 0.95
    assert np.all((field.confidence >= 0.0) & (field.confidence <= 1.0))
    assert field.is_finite()


def slight_motion(seed):
    rng = np.random.default_rng(seed)
    return turned(
        roll_deg=rng.uniform(-3, 3),
        zoom=rng.uniform(0.97, 1.03),
        shift=tuple(rng.uniform(-4, 4, size=2)),
    )


@pytest.mark.parametrize(
    "H",
    [
        *map(slight_motion, range(REPEATS)),
        turned(shift=(1.5, 0.5)),
        turned(shift=(6.5, 3.25)),
        pytest.param(
            turned(roll_deg=0.0, zoom=1.0, shift=(0.0, 1.375)),
            marks=pytest.mark.xfail(
                strict=True, reason="DIS is biased by 0.07 px where every pixel moves by 1.375 px"
            ),
        ),
    ],
)
def test_slight_motion_is_recovered_to_a_tenth_of_a_pixel(goal, H):
    """A bias of a twentieth of a pixel is 0.4 mm at 2 m; the goal asks for 50 mm."""
    truth = exact_flow(H)
    field = MATCHER.match(goal, MATCHER.encode(WALL.picture(H)))
    sure = field.confidence > 0.5
    assert sure.mean() > 0.9
    assert np.abs((field.flow - truth)[sure].mean(axis=0)).max() < 0.05
    assert errors(field, truth)[sure].mean() < 0.1
