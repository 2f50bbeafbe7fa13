"""Scores of a depth network against known depth."""

import numpy as np
import pytest

from dfvs_core.depth.network import NetworkDepth
from dfvs_core.errors import ImageError
from dfvs_export.bundles.card import depth_accuracy
from dfvs_models.depth_evaluation import MeasuredDepth, mean_score, score_depth

DEPTH_M = np.linspace(1.0, 5.0, 48, dtype=np.float32).reshape(6, 8)
DEPTH_M[0, 0] = 0.0  # unknown
RHO = np.divide(1.0, DEPTH_M, out=np.ones_like(DEPTH_M), where=DEPTH_M > 0)


def found(rho, unit="1/m", spread=0.1):
    rho = np.asarray(rho, np.float32)
    return NetworkDepth(rho, np.full_like(rho, spread), unit, 0.1 if unit == "1/m" else None)


def test_what_is_right_has_no_error_and_an_unknown_pixel_does_not_count():
    score = score_depth(found(np.where(DEPTH_M > 0, RHO, 77.0)), DEPTH_M)
    for error in (score.metric, score.aligned):
        assert error.abs_rel == pytest.approx(0.0, abs=1e-6)
        assert error.rmse_m == pytest.approx(0.0, abs=1e-6)
        assert error.close == 1.0
    assert score.within_spread == 1.0


@pytest.mark.parametrize("factor", [0.5, 1.2])
def test_a_wrong_scale_is_an_error_until_it_is_aligned(factor):
    score = score_depth(found(RHO / factor), DEPTH_M)
    assert score.metric.abs_rel == pytest.approx(abs(factor - 1.0), rel=1e-5)
    assert score.metric.close == (1.0 if 1 / 1.25 < factor < 1.25 else 0.0)
    assert score.scale_log == pytest.approx(np.log(factor), rel=1e-5)
    assert score.aligned.abs_rel == pytest.approx(0.0, abs=1e-6)


def test_an_affine_network_has_no_metric_error_and_is_aligned_by_scale_and_offset():
    score = score_depth(found(3.0 * RHO - 0.5, "affine"), DEPTH_M)
    assert score.metric is None
    assert score.aligned.rmse_m == pytest.approx(0.0, abs=1e-4)


@pytest.mark.parametrize("unit", ["affine", "relative"])
def test_only_metric_depth_has_an_error_of_the_scale(unit):
    score = score_depth(found(3.0 * RHO, unit), DEPTH_M)
    assert score.scale_log is None
    assert mean_score([score, score]).scale_log is None
    assert score.aligned.abs_rel == pytest.approx(0.0, abs=1e-4)
    measured = {"room.npz": MeasuredDepth(1, score, 13.0)}
    assert "scale is off" not in depth_accuracy(measured)


@pytest.mark.parametrize(
    ("unit", "scale", "share"), [("1/m", 1.0, 0.75), ("1/m", 2.0, 0.0), ("relative", 2.0, 0.75)]
)
def test_the_spread_holds_the_scale_of_metric_depth_and_no_other(unit, scale, share):
    noise = np.where(np.arange(48).reshape(6, 8) % 4 == 1, 0.3, 0.0)
    score = score_depth(found(scale * RHO * np.exp(noise), unit), DEPTH_M)
    assert score.within_spread == pytest.approx(share, abs=0.02)


def test_the_mean_holds_the_spread_of_the_scale():
    scores = [score_depth(found(RHO * s), DEPTH_M) for s in (0.5, 2.0)]
    mean = mean_score(scores)
    assert mean.scale_log == pytest.approx(np.log(2.0), rel=1e-5)
    assert mean.metric.abs_rel == pytest.approx((1.0 + 0.5) / 2, rel=1e-5)


@pytest.mark.parametrize("depth", [np.ones((3, 3), np.float32), np.zeros((6, 8), np.float32)])
def test_other_shapes_and_depth_that_is_nowhere_known_are_refused(depth):
    with pytest.raises(ImageError):
        score_depth(found(RHO), depth)
