"""Distortions that cannot be inverted over the image are refused, all others are not."""

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from dfvs_core.errors import GeometryError
from dfvs_core.geometry.camera import CameraModel
from dfvs_core.geometry.distortion import first_folds

RADII = np.tan(np.radians(np.linspace(0.0, 89.0, 5_000)))


def coefficient(limit):
    return st.floats(-limit, limit, allow_subnormal=False)


PLUMB_BOB = st.tuples(*map(coefficient, (1.5, 1.5, 0.0, 0.0, 1.5)))
RATIONAL = st.tuples(*map(coefficient, (2.0, 2.0, 0.0, 0.0, 2.0, 2.0, 2.0, 2.0)))


def camera(distortion, focal_px=400.0, size=(640, 480)):
    return CameraModel(*size, focal_px, focal_px, size[0] / 2, size[1] / 2, distortion)


def highest_px(distortion, focal_px):
    """How far from the principal point the image of a ray gets before it turns back, px."""
    k1, k2, _, _, k3, k4, k5, k6 = (*distortion, *(0.0,) * (8 - len(distortion)))
    s = RADII**2
    distorted = RADII * (1 + k1 * s + k2 * s**2 + k3 * s**3) / (1 + k4 * s + k5 * s**2 + k6 * s**3)
    is_falling = np.diff(distorted) <= 0
    return focal_px * distorted[is_falling.argmax()] if is_falling.any() else np.inf


@given(PLUMB_BOB | RATIONAL, st.floats(150.0, 1500.0))
def test_a_distortion_is_refused_if_it_turns_back_within_the_image(distortion, focal_px):
    highest, corner_px = highest_px(distortion, focal_px), np.hypot(320.0, 240.0)
    # Both examine it in steps; at the corner itself either may be right.
    assume(abs(highest - corner_px) > 0.02 * corner_px)
    if highest > corner_px:
        camera(distortion, focal_px)
        return
    with pytest.raises(GeometryError, match="folds back in the image"):
        camera(distortion, focal_px)


@given(
    st.tuples(*map(coefficient, (0.5, 0.5, 0.1, 0.1, 0.5, 0.5, 0.5, 0.5))),
    st.floats(-np.pi, np.pi),
)
def test_a_fold_is_where_the_image_of_a_small_square_is_turned_over(distortion, direction_rad):
    lens = camera((0.0,) * 4)
    object.__setattr__(lens, "distortion", distortion)

    def area(xy):
        """Signed area of the image of a small square at (2,), in squares."""
        step = 1e-6 * np.array([[1, 0], [-1, 0], [0, 1], [0, -1]])
        right, left, down, up = lens.denormalise(xy + step) / (2e-6 * 400.0)
        return np.linalg.det([right - left, down - up])

    folds = first_folds(distortion, np.array([direction_rad]))
    if len(folds) == 0:
        assert area(np.array([np.cos(direction_rad), np.sin(direction_rad)])) > 0
        return
    angle = np.arctan(np.linalg.norm(folds[0]))
    assume(angle < np.radians(70))
    assert area(folds[0]) > -1e-3
    beyond = np.tan(angle + np.radians(0.25))
    assert not area(beyond * np.array([np.cos(direction_rad), np.sin(direction_rad)])) > 1e-3


@pytest.mark.parametrize(
    ("distortion", "focal_px", "size"),
    [
        ((-0.3, 0.1, 0.0, 0.0), 250.0, (640, 480)),
        ((-0.4, 0.2, 0.0, 0.0, -0.05), 500.0, (640, 480)),
        ((-0.28, 0.07, 2e-4, 2e-5, 0.0), 458.0, (752, 480)),  # a wide lens, seen to 49 degrees
        ((-0.25, 0.06, 1e-3, -1e-3), 860.0, (1920, 1080)),  # an action camera
        ((0.45, -2.5, 6e-4, -2e-4, 1.45, 0.32, -2.3, 1.38), 605.0, (1280, 720)),  # a rational fit
        ((5.4, 3.6, -1e-4, -1e-5, 0.19, 5.73, 5.4, 0.97), 504.0, (640, 576)),  # a fisheye's
        ((0.0, 0.0, 0.0, 0.0), 50.0, (640, 480)),
    ],
)
def test_typical_calibrations_are_taken(distortion, focal_px, size):
    assert camera(distortion, focal_px, size).distortion == distortion


@pytest.mark.parametrize(
    "distortion",
    [
        (-0.4, 0.2, 0.0, 0.0, -0.05),
        (-1.6, 1.0, 0.0, 0.0),  # it rises again before the corner
        (0.0, 0.0, 0.3, 0.0),
        (0.0, 0.0, 0.0, -0.3, 0.0),
        (0.0, 0.0, 0.0, 0.0, 0.0, 1.5, 1.0, 0.0),
    ],
)
def test_what_folds_back_is_refused_with_its_place(distortion):
    with pytest.raises(GeometryError, match=r"\d+ px from .* \d+ degrees off .* expected .* again"):
        camera(distortion)


@pytest.mark.parametrize("focal_px", [300.0, 330.0, 500.0])
def test_the_rays_of_a_wide_lens_lead_back_to_their_pixels(focal_px):
    lens = camera((-0.3, 0.1, 0.0, 0.0), focal_px)
    pixels = lens.grid(8)
    np.testing.assert_allclose(lens.denormalise(lens.normalise(pixels)), pixels, atol=1e-3)


def test_a_pixel_outside_of_the_image_that_no_ray_leads_to_has_finite_coordinates():
    """Flow leads there; of a rational fit OpenCV gives what is no number."""
    fit = (-3.87, 3.483, 0.001, 0.001, 0.503, -5.064, 1.88, 1.317)
    lens = camera(fit, 192.0, (320, 240))
    outside = lens.grid(8) + np.array([0.0, 20.0])
    assert np.isfinite(lens.normalise(outside)).all()
