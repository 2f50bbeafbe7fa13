"""Properties of matching on random motions of a textured wall."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from textured_wall import HEIGHT, WIDTH, Wall, errors, exact_flow, inside, texture, turned

from dfvs_core.matching.classical import classical_matcher
from dfvs_core.matching.config import MatchingConfig
from dfvs_core.matching.correspondence import FlowField
from dfvs_core.matching.dense_search import forward_backward_consistency
from dfvs_core.matching.points import PointMatches
from dfvs_core.matching.smooth_flow import smooth_flow
from dfvs_core.matching.warping import compose
from dfvs_models.evaluation import score_pair

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


@settings(max_examples=REPEATS)
@given(H=MOTIONS)
def test_there_and_back_is_where_it_began(H):
    there, back = (exact_flow(each).astype(np.float32) for each in (H, np.linalg.inv(H)))
    seen = inside(there)
    assert np.abs(compose(there, back)[seen]).max() < 0.05
    assert forward_backward_consistency(there, back, MatchingConfig())[seen].min() > 0.99


@settings(max_examples=REPEATS)
@given(H=MOTIONS, seed=st.integers(0, 1000))
def test_exact_matches_of_a_plane_give_its_flow(H, seed):
    pixels = np.random.default_rng(seed).integers((0, 0), (WIDTH, HEIGHT), (400, 2))
    points, truth = pixels.astype(np.float32), exact_flow(H)
    others = points + truth[pixels[:, 1], pixels[:, 0]].astype(np.float32)
    matches = PointMatches(points, others, np.ones(len(points), np.float32))
    flow = smooth_flow(matches, (HEIGHT, WIDTH), MatchingConfig())
    assert np.mean(np.linalg.norm(flow - truth, axis=-1) < 0.5) > 0.98


@given(u=st.floats(-50, 50), v=st.floats(-50, 50))
def test_a_flow_that_is_off_by_a_constant_has_its_length_as_error(u, v):
    truth = np.zeros((8, 10, 2), np.float32)
    field = FlowField(np.full_like(truth, (u, v), dtype=np.float32), np.ones((8, 10), np.float32))
    score = score_pair(field, truth, np.ones((8, 10), bool))
    assert score.epe_px == pytest.approx(np.hypot(u, v), rel=1e-5, abs=1e-6)
