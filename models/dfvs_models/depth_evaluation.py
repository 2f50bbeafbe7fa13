"""Evaluation of depth and its uncertainty against ground truth."""

import time
from collections.abc import Sequence
from dataclasses import dataclass, fields
from pathlib import Path

import numpy as np

from dfvs_core.depth.network import DepthEstimator, NetworkDepth
from dfvs_core.errors import ImageError
from dfvs_core.geometry.arrays import Float32Array, FloatArray
from dfvs_models.evaluation_file import EVALUATION_CAMERA, read_depth_views

_CLOSE = 1.25
_LEAST_RHO = 1e-3
"""Inverse depth that is taken for less, 1/m: nothing indoors is a kilometre away."""
_METRIC = ("m", "1/m")
_WARM_UP = 2


@dataclass(frozen=True, slots=True)
class DepthError:
    """Errors of depth over pixels (Eigen et al., NIPS 2014).

    Parameters
    ----------
    abs_rel : float
        Mean of |found - true| / true.
    rmse_m : float
        Root of the mean square of found - true, m.
    close : float
        Share of pixels with max(found / true, true / found) under 1.25.
    """

    abs_rel: float
    rmse_m: float
    close: float


@dataclass(frozen=True, slots=True)
class DepthScore:
    """What the depth of one image, or the mean of several, came to.

    Parameters
    ----------
    metric : DepthError or None
        Of depth as it is; None unless it is metric.
    aligned : DepthError
        With the scale (of an affine network: scale and offset) that fits the truth best.
    scale_log : float or None
        ln of the scale of the found depth in that of the truth; None unless it is metric.
    within_spread : float
        Share of pixels whose logarithm (aligned, unless depth is metric) is off by less than its
        standard deviation: 0.68 where errors are normal and the uncertainty is honest.
    """

    metric: DepthError | None
    aligned: DepthError
    scale_log: float | None
    within_spread: float


@dataclass(frozen=True, slots=True)
class MeasuredDepth:
    """Mean score over the ``images`` of a file, and the median time of an estimate, ms."""

    images: int
    score: DepthScore
    median_ms: float


def measure_depth(network: DepthEstimator, path: Path) -> MeasuredDepth:
    """Score a network on an evaluation file.

    Raises
    ------
    ImageError
        If the file cannot be used.
    """
    images, depth_m = read_depth_views(path)
    camera = EVALUATION_CAMERA.scaled(images.shape[2], images.shape[1])
    for image in images[:_WARM_UP]:
        network.estimate(image, camera)
    scores, times = [], []
    for image, truth in zip(images, depth_m, strict=True):
        began = time.perf_counter()
        found = network.estimate(image, camera)
        times.append(1e3 * (time.perf_counter() - began))
        scores.append(score_depth(found, truth))
    return MeasuredDepth(len(scores), mean_score(scores), float(np.median(times)))


def score_depth(found: NetworkDepth, depth_m: Float32Array) -> DepthScore:
    """Score the depth of an image against the true one (H, W) m, over pixels where that is over 0.

    Raises
    ------
    ImageError
        If the shapes differ, or nothing is known.
    """
    known = depth_m > 0
    if found.rho.shape != depth_m.shape or not known.any():
        raise ImageError(
            f"depth of shape {found.rho.shape} against {depth_m.shape}, {known.sum()} known",
            "equal shapes and one known pixel or more",
        )
    true_rho = 1.0 / depth_m[known].astype(np.float64)
    rho = _aligned(found.rho[known].astype(np.float64), true_rho, found.unit)
    aligned, metric, scale_log = _error(rho, true_rho), None, None
    if found.unit in _METRIC:
        rho = np.maximum(found.rho[known], _LEAST_RHO).astype(np.float64)
        metric, scale_log = _error(rho, true_rho), _scale_log(rho, true_rho)
    within = np.abs(np.log(rho / true_rho)) < found.spread[known]
    return DepthScore(metric, aligned, scale_log, float(within.mean()))


def mean_score(scores: Sequence[DepthScore]) -> DepthScore:
    """Mean over one image or more; ``scale_log`` is the standard deviation around 0."""
    metric = [s.metric for s in scores if s.metric is not None]
    scales = [s.scale_log for s in scores if s.scale_log is not None]
    return DepthScore(
        _mean(metric) if metric else None,
        _mean([s.aligned for s in scores]),
        float(np.sqrt(np.mean(np.square(scales)))) if scales else None,
        float(np.mean([s.within_spread for s in scores])),
    )


def _aligned(rho: FloatArray, true_rho: FloatArray, unit: str) -> FloatArray:
    """Inverse depth in the truth's units."""
    if unit == "affine":
        terms = np.column_stack([rho, np.ones_like(rho)])
        (gain, offset), *_ = np.linalg.lstsq(terms, true_rho, rcond=None)
        fitted: FloatArray = np.maximum(gain * rho + offset, _LEAST_RHO)
    else:
        fitted = np.maximum(rho, _LEAST_RHO)
        fitted *= np.exp(_scale_log(fitted, true_rho))
    return fitted


def _scale_log(rho: FloatArray, true_rho: FloatArray) -> float:
    return float(np.median(np.log(true_rho / rho)))


def _error(rho: FloatArray, true_rho: FloatArray) -> DepthError:
    ratio = true_rho / rho
    return DepthError(
        abs_rel=float(np.mean(np.abs(ratio - 1.0))),
        rmse_m=float(np.sqrt(np.mean((1.0 / rho - 1.0 / true_rho) ** 2))),
        close=float(np.mean(np.maximum(ratio, 1.0 / ratio) < _CLOSE)),
    )


def _mean(errors: Sequence[DepthError]) -> DepthError:
    columns = [[getattr(e, f.name) for e in errors] for f in fields(DepthError)]
    return DepthError(*(float(np.mean(column)) for column in columns))
