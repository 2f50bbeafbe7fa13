"""Plots of a flight, drawn of telemetry documents and the true path."""

from types import SimpleNamespace

import cv2
import numpy as np
import pytest

from dfvs_sim.demo.plots import write_plots
from dfvs_sim.demo.track import TrackPoint

S = 1_000_000_000
DISTANCE_PLOT = np.s_[396:, :440]
"""Rows and columns of the plot of the distance: lower left of two by three."""


def document(t_s, error_m, error_spread_m):
    return {
        "t_capture_ns": int(t_s * S),
        "velocity": [0.1, 0.0, 0.0, 0.0],
        "error_m": error_m,
        "error_spread_m": error_spread_m,
        "error_rad": 0.1,
        "feature_error_px": 3.0,
        "residual_px": 0.5,
        "overlap": 0.8,
        "inlier_share": 0.9,
        "depth_m": 2.5,
    }


def flight(documents):
    def point(t_s):
        T = np.eye(4)
        T[0, 3] = 0.1 * t_s
        return TrackPoint(int(t_s * S), T, 1.0 - 0.09 * t_s, 0.1)

    return SimpleNamespace(
        plan=SimpleNamespace(T_scene_goal=np.eye(4)),
        track=SimpleNamespace(points=[point(t_s) for t_s in range(10)]),
        watch=SimpleNamespace(servo=documents),
        engaged_ns=0,
    )


def distance_plot(documents, folder):
    return cv2.imread(str(write_plots(flight(documents), folder / "plots.png")))[DISTANCE_PLOT]


@pytest.fixture
def band_pixels(tmp_path):
    """How many pixels of the distance's plot have the band's pale orange."""

    def band_pixels(documents):
        blue, green, red = np.moveaxis(distance_plot(documents, tmp_path).astype(int), -1, 0)
        return int(((red > 230) & (blue > 150) & (red - blue > 20) & (green < red)).sum())

    return band_pixels


def test_the_distance_has_a_band_where_its_spread_is_known(band_pixels):
    known = [document(t_s, 1.0 - 0.09 * t_s, 0.3) for t_s in range(10)]
    half = [d | {"error_spread_m": None} if i < 5 else d for i, d in enumerate(known)]
    unknown = [d | {"error_spread_m": None} for d in known]
    assert band_pixels(known) > 1.3 * band_pixels(half) > 1.3 * band_pixels(unknown)


def test_a_spread_beyond_the_distance_and_refused_frames_are_drawn(band_pixels):
    wide = [document(t_s, 0.02, 0.5) for t_s in range(5)]
    refused = [document(t_s, None, None) for t_s in range(5, 10)]
    assert band_pixels(wide + refused) > 0
    assert band_pixels(refused) >= 0
