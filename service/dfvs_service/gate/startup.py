"""Time limits of the start: perception's first report, then the first frame that can be read."""

from dfvs_core.errors import DfvsError
from dfvs_core.gate.config import S

PERCEPTION_START_S = 900
"""Longest time from PREFLIGHT to perception's first report: TensorRT may build engines first."""


class StartupWatch:
    """Says that perception never reported, or that no frame ever came that could be read.

    Parameters
    ----------
    frame_timeout_s : float
        Longest time from perception's first report to the first frame.
    """

    def __init__(self, frame_timeout_s: float) -> None:
        self._frame_timeout_s = frame_timeout_s
        self._since_ns: int | None = None

    def evaluate(self, now_ns: int, first_report_ns: int | None, reason: str) -> DfvsError | None:
        """Error once the time is up, in PREFLIGHT and while no frame could be read.

        Parameters
        ----------
        now_ns, first_report_ns : int
            Monotonic times; None as long as perception has not reported.
        reason : str
            Why perception has no frames.
        """
        if self._since_ns is None:
            self._since_ns = now_ns
        if first_report_ns is None:
            if now_ns - self._since_ns < PERCEPTION_START_S * S:
                return None
            return DfvsError(
                f"perception reported nothing within {PERCEPTION_START_S} s",
                "a model that is loaded by then",
                "does TensorRT build its engines anew at every start?",
            )
        if now_ns - max(self._since_ns, first_report_ns) < self._frame_timeout_s * S:
            return None
        return DfvsError(
            f"no usable camera frame within {self._frame_timeout_s:g} s ({reason})",
            "frames on the camera's Zenoh key, stamped on this machine's CLOCK_MONOTONIC",
            "if none came: is the camera publishing, and do vehicle.name and the zenoh section "
            "agree with it?",
        )
