"""Paced feeds of captured images, live or recorded."""

import contextlib
import threading
import time
from collections.abc import Callable
from typing import Protocol

from dfvs_core.errors import DfvsError
from dfvs_service.camera.sources.source import Source
from dfvs_service.camera.sources.spec import CameraError, SourceLostError
from dfvs_service.frames import CapturedImage
from dfvs_service.mailbox import Mailbox

RETRY_S = 1.0
DEFAULT_RATE_HZ = 20.0

Opener = Callable[[], Source]
Log = Callable[[str], None]


class Feed(Protocol):
    """Source of images at its pace."""

    ended: bool
    """No more images will come."""

    def receive(self, timeout_s: float) -> CapturedImage | None:
        """Next image, None if none came within about the timeout."""

    def close(self) -> None:
        """End it."""


class LiveFeed:
    """The newest image of a live source, read on a thread of its own and reopened when lost.

    ``opener`` raises SourceLostError where trying again may help, which is done after ``retry_s``.
    ``log`` takes a line for the user whenever the source is lost or back.
    """

    ended = False

    def __init__(self, opener: Opener, log: Log, retry_s: float = RETRY_S) -> None:
        self._opener = opener
        self._log = log
        self._retry_s = retry_s
        self._mailbox: Mailbox[CapturedImage | DfvsError] = Mailbox()
        self._stop = threading.Event()
        self._trouble = ""
        self._thread = threading.Thread(target=self._work, name="camera", daemon=True)
        self._thread.start()

    def receive(self, timeout_s: float) -> CapturedImage | None:
        """Newest image.

        Raises
        ------
        DfvsError
            If the source cannot be used and trying again would not help.
        """
        had_ended = not self._thread.is_alive()
        item = self._mailbox.get(timeout_s)
        if isinstance(item, DfvsError):
            raise item
        if item is None and had_ended:
            raise CameraError(
                "the thread that reads the camera ended by itself", remedy="see its traceback above"
            )
        return item

    def close(self) -> None:
        """Stop reading; a source that blocks is left to the end of the process."""
        self._stop.set()
        self._thread.join(timeout=1.0)

    def _work(self) -> None:
        while not self._stop.is_set():
            try:
                self._read_until_lost()
            except SourceLostError as error:
                self._complain(str(error))
                self._stop.wait(self._retry_s)
            except DfvsError as error:
                self._mailbox.put(error)
                return

    def _read_until_lost(self) -> None:
        with contextlib.closing(self._opener()) as source:
            while not self._stop.is_set():
                captured = source.read()
                if captured is None:
                    raise SourceLostError("the source has ended")
                self._mailbox.put(captured)
                if self._trouble:
                    self._trouble = ""
                    self._log("the source is back")

    def _complain(self, problem: str) -> None:
        """Say what is wrong once, not once a second."""
        if problem != self._trouble:
            self._trouble = problem
            self._log(f"{problem}; trying again every {self._retry_s:g} s")


class RecordedFeed:
    """Images of a file at its own rate or a given one, once or over and over.

    Every image is stamped anew when it is due: a recording is flown by as if it were live.
    """

    def __init__(self, opener: Opener, rate_hz: float | None, *, loop: bool) -> None:
        self._opener = opener
        self._source = opener()
        self._loop = loop
        self._period_s = 1.0 / (rate_hz or self._source.rate_hz or DEFAULT_RATE_HZ)
        self._due_s = time.monotonic()
        self.ended = False

    def receive(self, timeout_s: float) -> CapturedImage | None:
        """Next image when it is due.

        Raises
        ------
        DfvsError
            If an image cannot be read.
        """
        wait_s = self._due_s - time.monotonic()
        if wait_s > timeout_s:
            time.sleep(timeout_s)
            return None
        captured = self._source.read()
        if captured is None and self._loop:
            self._source.close()
            self._source = self._opener()
            captured = self._source.read()
        if captured is None:
            self.ended = True
            return None
        time.sleep(max(self._due_s - time.monotonic(), 0.0))
        now_s = time.monotonic()
        self._due_s = max(self._due_s + self._period_s, now_s)
        return CapturedImage(captured.image, time.monotonic_ns())

    def close(self) -> None:
        """Close the file."""
        self._source.close()
