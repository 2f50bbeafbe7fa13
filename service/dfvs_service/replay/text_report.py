"""Text report of a comparison."""

import math
from collections.abc import Sequence

from dfvs_service.replay.comparison import Comparison, Spread


def text_report(comparison: Comparison, reasons: Sequence[str]) -> str:
    """Some lines about a comparison.

    Parameters
    ----------
    comparison : Comparison
    reasons : sequence of str
        Why the replay may differ; none where it must not.
    """
    total = len(comparison.frames)
    lines = [verdict(comparison, reasons)]
    lines += [f"  other than in flight: {reason}" for reason in reasons]
    if not comparison.is_identical and total:
        lines += [
            f"frames             {total}, {comparison.identical} identical, first difference in "
            f"turn {comparison.first_difference}",
            f"flown by           {comparison.healthy_recorded} recorded, "
            f"{comparison.healthy_replayed} replayed, {comparison.healthy_both} both",
            f"velocity           {_spread(comparison.velocity_m_s, 1.0, 'm/s')}",
            f"yaw rate           {_spread(comparison.yaw_rate_rad_s, math.degrees(1.0), '°/s')}",
            f"error, distance    {_spread(comparison.error_m, 1.0, 'm')}",
            f"error, angle       {_spread(comparison.error_rad, math.degrees(1.0), '°')}",
        ]
    lines += [
        f"{name.replace('_', ', '):<18} {value.p50_ms:.1f} ms median, {value.p99_ms:.1f} ms p99"
        for name, value in comparison.latency.items()
    ]
    return "\n".join(lines)


def verdict(comparison: Comparison, reasons: Sequence[str]) -> str:
    """One sentence on whether the replay is the flight."""
    total = len(comparison.frames)
    if not total:
        return "no frames to replay"
    if comparison.is_identical:
        return f"identical: all {total} commands are the same, bit for bit"
    if reasons:
        return f"{total - comparison.identical} of {total} commands differ"
    return (
        f"NOT identical: {total - comparison.identical} of {total} commands differ although "
        "build, model and settings are the same"
    )


def _spread(spread: Spread | None, factor: float, unit: str) -> str:
    if spread is None:
        return "no frame was flown by in both"
    return (
        f"differs by {spread.p50 * factor:.4f} {unit} in the median, "
        f"{spread.p95 * factor:.4f} p95, {spread.greatest * factor:.4f} at most"
    )
