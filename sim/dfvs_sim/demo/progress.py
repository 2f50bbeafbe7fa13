"""What the user sees in the terminal while a flight is on."""

import contextlib
import math

from dfvs_common.progress import StatusLine, log
from dfvs_sim.demo.flight.telemetry import TelemetryWatch
from dfvs_sim.demo.flight.track import Track


class Progress:
    """One line that is rewritten in a terminal, and a line a second in a file or pipe."""

    def __init__(self) -> None:
        self._line = StatusLine()
        self._calls = 0

    def log(self, text: str) -> None:
        """Print a line of its own."""
        self._line.end()
        log(text)

    def close(self) -> None:
        """End the line that is rewritten, where the terminal is still there."""
        with contextlib.suppress(OSError):
            self._line.end()

    def show(self, watch: TelemetryWatch, track: Track) -> None:
        """Show state, estimated and true error."""
        self._calls += 1
        if not self._line.is_live and self._calls % 5 != 1:
            return
        line = f"  {watch.state or 'waiting':8s}"
        if watch.servo:
            newest = watch.servo[-1]
            line += f" sees {_error(newest['error_m'], newest['error_rad'])}"
        if track.points:
            last = track.points[-1]
            line += f" | truly {_error(last.error_m, last.error_rad)}"
        show = self._line.show if self._line.is_live else log
        show(line)


def _error(metres: float | None, radians: float | None) -> str:
    if metres is None or radians is None:
        return "   --        --   "
    return f"{metres:6.3f} m {math.degrees(radians):6.2f} deg"
