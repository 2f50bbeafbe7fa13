"""Report whether a subscriber receives the camera's frames."""

from dataclasses import dataclass

from dfvs_service.camera.feed import Log
from dfvs_service.camera.sources.spec import CameraError

_PATIENCE_S = 2.0
_REMEDY = (
    "start the service, or compare --vehicle and --connect with its settings; with TLS, the "
    "camera's certificate must have the role of a camera"
)


@dataclass(slots=True)
class ReceptionReport:
    """Logs when nobody receives the frames, and when somebody does again.

    Parameters
    ----------
    log : callable
        Takes a line for the user.
    key : str
        Zenoh key of the frames.
    lost_s : float
        Monotonic time since which nobody is known to receive.
    required_s : float, optional
        Without a subscriber for so long the camera ends.
    """

    log: Log
    key: str
    lost_s: float
    required_s: float | None = None
    is_received: bool = False
    is_reported: bool = False

    def update(self, now_s: float, *, is_received: bool) -> None:
        """Take whether there is a subscriber now.

        Raises
        ------
        CameraError
            If there was none for ``required_s``.
        """
        if is_received:
            if self.is_reported:
                self.log(f"{self.key} has a subscriber")
            self.is_received, self.is_reported = True, False
            return
        if self.is_received:
            self.is_received, self.lost_s = False, now_s
        alone_s = now_s - self.lost_s
        if self.required_s is not None and alone_s >= self.required_s:
            raise CameraError(
                f"nobody receives {self.key} for {alone_s:.0f} s", "a subscriber", _REMEDY
            )
        if alone_s >= _PATIENCE_S and not self.is_reported:
            self.is_reported = True
            self.log(f"nobody receives {self.key}: {_REMEDY}")
