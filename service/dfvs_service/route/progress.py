"""Progress of a route recording in lines for the pilot."""

from collections.abc import Callable

from dfvs_service.route.recording import Event

_REPORT_S = 2.0
"""Time without frames until that is said, and between two lines about bad frames."""


class RouteProgress:
    """Says which goals were taken, why frames are refused, and that none come.

    Parameters
    ----------
    key : str
        Where frames are awaited.
    log : callable
        Takes a line.
    now_s : callable
        Monotonic time in s.
    """

    def __init__(self, key: str, log: Callable[[str], None], now_s: Callable[[], float]) -> None:
        self._key = key
        self._log = log
        self._now_s = now_s
        self._received_s = now_s()
        self._warned_s = self._refused_s = self._received_s - _REPORT_S
        self._refusal = ""
        self._is_silence_told = False
        log(f"waiting for frames on {key}")

    def on_silence(self) -> None:
        """No frame came."""
        if self._now_s() - self._received_s >= _REPORT_S and not self._is_silence_told:
            self._is_silence_told = True
            self._log(f"no frames on {self._key}: is the camera publishing?")

    def on_frame(self, event: Event, count: int, refusal: str) -> None:
        """Update by a frame: what it led to, the number of goals, and why it was refused.

        A refusal is said once, until frames are accepted for a while or another reason comes.
        """
        now_s = self._received_s = self._now_s()
        self._is_silence_told = False
        if event is Event.SAVED:
            self._log(f"goal {count}")
        elif event is Event.LOST:
            self._warn(f"goal {count} is out of sight: fly back to where it was taken")
        elif refusal:
            self._refused_s = now_s
            if refusal != self._refusal and self._warn(f"frames are refused: {refusal}"):
                self._refusal = refusal
        if now_s - self._refused_s >= _REPORT_S:
            self._refusal = ""

    def _warn(self, line: str) -> bool:
        """Log a line unless the last one has only just been; returns whether it was logged."""
        now_s = self._now_s()
        if now_s - self._warned_s < _REPORT_S:
            return False
        self._warned_s = now_s
        self._log(line)
        return True
