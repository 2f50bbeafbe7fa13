"""Comparison of a recorded flight with its replay: differences and durations, also as JSON."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from dfvs_core.messages.link import PerceptionReport
from dfvs_core.messages.schema import dump
from dfvs_service.replay.rerun import Rerun

MATCH_STAGES = ("prepare", "match")
FRAME_STAGES = ("decode", "prepare", "match", "servo")


@dataclass(frozen=True, slots=True)
class Percentiles:
    """Durations in ms."""

    p50_ms: float
    p99_ms: float


@dataclass(frozen=True, slots=True)
class FrameDifference:
    """One frame: replayed minus recorded, and both.

    ``velocity_m_s`` is the length of the difference of the velocities. Differences are None
    unless both would have been flown by.
    """

    record: int
    t_ns: int
    identical: bool
    recorded: PerceptionReport
    replayed: PerceptionReport
    velocity_m_s: float | None
    yaw_rate_rad_s: float | None
    error_m: float | None
    error_rad: float | None


@dataclass(frozen=True, slots=True)
class Comparison:
    """All frames, and their sum.

    ``first_difference`` is the record of the first frame that is not identical; latencies are of
    the stages that both have: matching, and all from decoding to the command.
    """

    frames: tuple[FrameDifference, ...]
    identical: int
    first_difference: int | None
    healthy_recorded: int
    healthy_replayed: int
    healthy_both: int
    velocity_m_s: Spread | None
    yaw_rate_rad_s: Spread | None
    error_m: Spread | None
    error_rad: Spread | None
    latency: dict[str, Percentiles]

    @property
    def is_identical(self) -> bool:
        """Whether the reports to the gate are the very same, frame by frame."""
        return bool(self.frames) and self.identical == len(self.frames)


@dataclass(frozen=True, slots=True)
class Spread:
    """Median, 95th percentile and greatest of absolute differences."""

    p50: float
    p95: float
    greatest: float


def compare(reruns: Sequence[Rerun]) -> Comparison:
    """Compare every frame of a replay with what was recorded of it."""
    frames = tuple(_difference(rerun) for rerun in reruns)
    different = [frame.record for frame in frames if not frame.identical]
    both = sum(f.recorded.healthy and f.replayed.healthy for f in frames)
    return Comparison(
        frames=frames,
        identical=len(frames) - len(different),
        first_difference=different[0] if different else None,
        healthy_recorded=sum(frame.recorded.healthy for frame in frames),
        healthy_replayed=sum(frame.replayed.healthy for frame in frames),
        healthy_both=both,
        velocity_m_s=_spread([frame.velocity_m_s for frame in frames]),
        yaw_rate_rad_s=_spread([frame.yaw_rate_rad_s for frame in frames]),
        error_m=_spread([frame.error_m for frame in frames]),
        error_rad=_spread([frame.error_rad for frame in frames]),
        latency=_latency(reruns),
    )


def _difference(rerun: Rerun) -> FrameDifference:
    then, now = rerun.record.report, rerun.report
    common = (rerun.record.number, rerun.record.t_ns, rerun.is_identical, then, now)
    if not (then.healthy and now.healthy):
        return FrameDifference(*common, None, None, None, None)
    away = [b - a for a, b in zip(then.velocity, now.velocity, strict=True)]
    return FrameDifference(
        *common,
        math.hypot(*away[:3]),
        away[3],
        now.error_m - then.error_m,
        now.error_rad - then.error_rad,
    )


def _spread(values: Sequence[float | None]) -> Spread | None:
    known = np.abs(np.array([value for value in values if value is not None]))
    if not known.size:
        return None
    p50, p95, greatest = (float(v) for v in np.percentile(known, [50, 95, 100]))
    return Spread(p50, p95, greatest)


def _latency(reruns: Sequence[Rerun]) -> dict[str, Percentiles]:
    """Percentiles over the frames that went all the way in flight and in replay."""
    whole = [
        r for r in reruns if r.record.sight is not None and "servo" in r.record.sight.stages_ns
    ]
    if not whole:
        return {}
    flown = [r.record.sight.stages_ns for r in whole if r.record.sight is not None]
    return {
        "match_recorded": _percentiles([sum(s[k] for k in MATCH_STAGES) for s in flown]),
        "match_replayed": _percentiles([r.match_ns for r in whole]),
        "frame_recorded": _percentiles([sum(s[k] for k in FRAME_STAGES) for s in flown]),
        "frame_replayed": _percentiles([r.frame_ns for r in whole]),
    }


def _percentiles(durations_ns: Sequence[int]) -> Percentiles:
    p50, p99 = (float(v) * 1e-6 for v in np.percentile(np.array(durations_ns), [50, 99]))
    return Percentiles(round(p50, 3), round(p99, 3))


def as_document(comparison: Comparison, reasons: Sequence[str]) -> dict[str, Any]:
    """All of a comparison as JSON; lengths in m, angles in rad."""
    document: dict[str, Any] = dump(comparison)
    return {
        "is_identical": comparison.is_identical,
        "must_be_identical": not reasons,
        "reasons_to_differ": list(reasons),
        **document,
        "frames": [_frame(frame) for frame in comparison.frames],
    }


def _frame(frame: FrameDifference) -> dict[str, Any]:
    """One frame; of the reports what is flown by."""
    document: dict[str, Any] = dump(frame)
    for name, report in (("recorded", frame.recorded), ("replayed", frame.replayed)):
        document[name] = {
            "healthy": report.healthy,
            "reason": report.reason,
            "velocity": list(report.velocity),
            "error_m": report.error_m,
            "error_rad": report.error_rad,
        }
    return document
