"""Comparison as JSON."""

from collections.abc import Sequence
from typing import Any

from dfvs_core.messages.schema import dump
from dfvs_service.replay.comparison import Comparison, FrameDifference


def as_document(comparison: Comparison, reasons: Sequence[str]) -> dict[str, Any]:
    """All of a comparison; lengths in m, angles in rad."""
    document: dict[str, Any] = dump(comparison)
    frames = [_frame(frame) for frame in comparison.frames]
    return {
        "is_identical": comparison.is_identical,
        "must_be_identical": not reasons,
        "reasons_to_differ": list(reasons),
        **document,
        "frames": frames,
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
