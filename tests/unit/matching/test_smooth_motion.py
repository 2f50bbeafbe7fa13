"""Fitting a homography and a spline to matches with noise, gross errors and gaps."""

import cv2
import numpy as np
import pytest
from textured_wall import HEIGHT, WIDTH, exact_flow, turned

from dfvs_core.matching.features import Matches
from dfvs_core.matching.motion import fit_motion

SIZE = (HEIGHT, WIDTH)


def scattered(rng, count, low=(0, 0), high=(WIDTH, HEIGHT)):
    return rng.uniform(low, high, (count, 2)).astype(np.float32)


def moved(H, points):
    return cv2.perspectiveTransform(points[:, None].astype(np.float64), H)[:, 0]


def test_a_homography_is_found_in_spite_of_noise_and_a_third_of_gross_errors(rng):
    H = turned(roll_deg=25.0, zoom=1.2, shift=(20.0, -10.0), perspective=(8e-4, -5e-4))
    points = scattered(rng, 150)
    targets = moved(H, points) + rng.normal(0, 0.5, (150, 2))
    targets[:50] = scattered(rng, 50)
    motion = fit_motion(Matches(points, targets.astype(np.float32)), SIZE)
    error = np.linalg.norm(motion.flow() - exact_flow(H), axis=-1)
    # half a pixel of noise on a hundred matches, and a spline that may follow it a little
    assert np.median(error) < 0.5
    assert error.max() < 6.0


def test_the_spline_follows_parallax_that_no_homography_explains(rng):
    points = scattered(rng, 300)
    bump = 12.0 * np.exp(-((points - [220, 120]) ** 2).sum(axis=1) / (2 * 50.0**2))
    targets = points + np.stack([bump, np.zeros_like(bump)], axis=1)
    motion = fit_motion(Matches(points, targets.astype(np.float32)), SIZE)
    flow = motion.flow()
    assert flow[120, 220, 0] == pytest.approx(12.0, abs=1.5)
    assert flow[200, 30, 0] == pytest.approx(0.0, abs=0.5)


def test_flow_and_single_points_agree(rng):
    points = scattered(rng, 60)
    targets = (points + rng.normal(0, 5, points.shape)).astype(np.float32)
    motion = fit_motion(Matches(points, targets), SIZE)
    pixels = np.array([[0, 0], [319, 239], [100, 57]], np.float32)
    expected = [motion.flow()[int(v), int(u)] for u, v in pixels]
    np.testing.assert_allclose(motion.at(pixels) - pixels, expected, atol=1e-3)


@pytest.mark.parametrize("count", [1, 2, 3])
def test_few_matches_give_a_tame_motion_and_no_failure(rng, count):
    points = scattered(rng, count, low=(100, 80), high=(220, 160))
    flow = fit_motion(Matches(points, points + np.float32([7.0, -3.0])), SIZE).flow()
    assert np.isfinite(flow).all()
    assert np.abs(flow - [7.0, -3.0]).max() < 2.0


def test_matches_in_one_corner_do_not_run_wild_in_the_opposite_one(rng):
    """The prior holds what a small patch cannot determine: perspective most of all."""
    H = turned(roll_deg=8.0, shift=(15.0, 5.0))
    points = scattered(rng, 40, high=(90, 70))
    targets = moved(H, points) + rng.normal(0, 0.7, points.shape)
    flow = fit_motion(Matches(points, targets.astype(np.float32)), SIZE).flow()
    assert np.linalg.norm(flow - exact_flow(H), axis=-1).max() < 40.0


def test_the_order_of_matches_does_not_matter(rng):
    points = scattered(rng, 80)
    targets = (points + rng.normal(0, 4, points.shape)).astype(np.float32)
    shuffled = rng.permutation(80)
    one = fit_motion(Matches(points, targets), SIZE).flow()
    two = fit_motion(Matches(points[shuffled], targets[shuffled]), SIZE).flow()
    np.testing.assert_allclose(one, two, atol=1e-3)
