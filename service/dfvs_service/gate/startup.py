"""Time limits of the start: perception's first report, then the first frame that can be read."""

from dfvs_core.errors import DfvsError
from dfvs_core.gate.config import S

PERCEPTION_START_S = 900
"""Longest time from PREFLIGHT to perception's first report: TensorRT may build engines first."""


def startup_problem(
    waited_ns: int, reported_ns: int | None, timeout_s: float, reason: str
) -> DfvsError | None:
    """Error once the time is up, in PREFLIGHT and while no frame could be read.

    ``waited_ns`` and ``reported_ns`` are the times since PREFLIGHT was entered and since
    perception's first report, None without one. ``timeout_s`` is the longest time from the later of
    the two to the first frame, ``reason`` why perception has no frames.
    """
    if reported_ns is None:
        if waited_ns < PERCEPTION_START_S * S:
            return None
        return DfvsError(
            f"perception reported nothing within {PERCEPTION_START_S} s",
            "a model that is loaded by then",
            "does TensorRT build its engines anew at every start?",
        )
    if min(waited_ns, reported_ns) < timeout_s * S:
        return None
    return DfvsError(
        f"no usable camera frame within {timeout_s:g} s ({reason})",
        "frames on the camera's Zenoh key, stamped on this machine's CLOCK_MONOTONIC",
        "if none came: is the camera publishing, and do vehicle.name and the zenoh section "
        "agree with it?",
    )
