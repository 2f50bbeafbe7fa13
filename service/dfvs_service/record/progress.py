"""Progress line of a recording."""

from __future__ import annotations

from typing import TextIO

from dfvs_service.record.recorder import Recorder


class ProgressLine:
    """Rewrites one line; says nothing where there is no terminal."""

    def __init__(self, stream: TextIO) -> None:
        self._stream = stream
        self._shown = stream.isatty()

    def show(self, recorder: Recorder) -> None:
        """Take the newest state."""
        if not self._shown:
            return
        counts, path = recorder.counts, recorder.path
        where = "waiting for a flight" if path is None else path.name
        lost = counts.missing + counts.dropped
        size_mb = recorder.size_bytes / 1e6
        self._stream.write(
            f"\r\x1b[K{counts.records} frame records, {size_mb:.1f} MB, {lost} lost  {where}"
        )
        self._stream.flush()

    def close(self) -> None:
        """End the line."""
        if self._shown:
            self._stream.write("\n")
