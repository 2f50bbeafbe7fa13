"""Telemetry documents about perception as plain mappings, and the latencies in them."""

import math
from collections import defaultdict, deque
from collections.abc import Mapping
from typing import Any

import numpy as np

from dfvs_core.messages.frame import Frame
from dfvs_core.perception.frame_result import FrameResult
from dfvs_core.servo.exchange import Uncertainty

WINDOW = 300


def servo_document(
    frame: Frame, frame_result: FrameResult, t_ns: int, stages_ns: Mapping[str, int]
) -> dict[str, Any]:
    """One frame's result; lengths in m, angles in rad, px where the name says so."""
    result = frame_result.result
    return {
        "t_ns": t_ns,
        "t_capture_ns": frame.t_capture_ns,
        "seq": frame.seq,
        "status": result.status.name,
        "reason": "" if frame_result.report.healthy else result.status.value,
        "velocity": [float(v) for v in result.velocity],
        "motion": [float(v) for v in result.motion],
        "error_m": _number(result.error_m),
        "error_rad": _number(result.error_rad),
        "median_error_px": _number(result.median_error_px),
        "residual_px": _number(result.residual_px),
        "inlier_share": result.inlier_share,
        "overlap": result.overlap,
        "condition": _number(result.condition),
        "depth_m": result.depth_m,
        "reached": bool(result.reached),
        "tracking": frame_result.tracking.value,
        "mounting_score": result.mounting_score,
        **_uncertainty(result.uncertainty),
        "stages_ms": {name: duration * 1e-6 for name, duration in stages_ns.items()},
    }


def _uncertainty(uncertainty: Uncertainty | None) -> dict[str, Any]:
    """What is known of the estimator's own errors; null where nothing is."""
    if uncertainty is None:
        names = ("error_spread_m", "scale_spread", "odometry_error_m_s", "mean_error_m")
        return {**dict.fromkeys((*names, "mean_error_spread_m")), "velocity_error": None}
    return {
        "error_spread_m": _number(uncertainty.error_m),
        "scale_spread": _number(uncertainty.scale),
        "odometry_error_m_s": _number(uncertainty.velocity_error_m_s),
        "mean_error_m": _number(uncertainty.mean_error_m),
        "mean_error_spread_m": _number(uncertainty.spread_m),
        "velocity_error": [float(v) for v in uncertainty.velocity_error],
    }


def timing_document(
    stages: Mapping[str, Mapping[str, float]], t_ns: int, counters: Mapping[str, int]
) -> dict[str, Any]:
    """Latency of every stage over the last frames, and what was counted since the start."""
    return {"t_ns": t_ns, "stages": dict(stages), **counters}


def _number(value: float) -> float | None:
    """JSON has no infinity: unknown is null."""
    return float(value) if math.isfinite(value) else None


class LatencyWindow:
    """The last durations of every stage."""

    def __init__(self) -> None:
        self._stages: defaultdict[str, deque[int]] = defaultdict(lambda: deque(maxlen=WINDOW))

    def add(self, stages_ns: dict[str, int]) -> None:
        """Take in one frame's durations, ns by stage."""
        for name, duration in stages_ns.items():
            self._stages[name].append(duration)

    def summary(self) -> dict[str, dict[str, float]]:
        """p50, p99 and max in ms by stage."""
        return {name: _percentiles(values) for name, values in self._stages.items()}


def _percentiles(values: deque[int]) -> dict[str, float]:
    p50, p99, most = np.percentile(np.array(values), [50, 99, 100]) * 1e-6
    return {
        "p50_ms": round(float(p50), 3),
        "p99_ms": round(float(p99), 3),
        "max_ms": round(float(most), 3),
    }
