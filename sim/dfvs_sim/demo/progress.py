"""What the user sees in the terminal while a flight is on."""

import contextlib
import math
import sys
from typing import TextIO

from dfvs_sim.demo.flight.telemetry import TelemetryWatch
from dfvs_sim.demo.flight.track import Track


class Progress:
    """One line that is rewritten in a terminal, and a line a second in a file or pipe."""

    def __init__(self, stream: TextIO | None = None) -> None:
        self._stream = stream or sys.stderr
        self._live = self._stream.isatty()
        self._calls = 0
        self._open_line = False

    def log(self, text: str) -> None:
        """Print a line of its own."""
        if self._open_line:
            self._stream.write("\n")
            self._open_line = False
        print(text, file=self._stream, flush=True)

    def close(self) -> None:
        """End the line that is rewritten, where the terminal is still there."""
        if self._open_line:
            with contextlib.suppress(OSError):
                self._stream.write("\n")
                self._stream.flush()
        self._open_line = False

    def show(self, watch: TelemetryWatch, track: Track) -> None:
        """Show state, estimated and true error."""
        self._calls += 1
        if not self._live and self._calls % 5 != 1:
            return
        line = f"  {watch.state or 'waiting':8s}"
        if watch.servo:
            newest = watch.servo[-1]
            line += f" sees {_error(newest['error_m'], newest['error_rad'])}"
        if track.points:
            last = track.points[-1]
            line += f" | truly {_error(last.error_m, last.error_rad)}"
        if self._live:
            self._stream.write(f"\r{line:<78}")
            self._stream.flush()
            self._open_line = True
        else:
            print(line, file=self._stream, flush=True)


def _error(metres: float | None, radians: float | None) -> str:
    if metres is None or radians is None:
        return "   --        --   "
    return f"{metres:6.3f} m {math.degrees(radians):6.2f} deg"
