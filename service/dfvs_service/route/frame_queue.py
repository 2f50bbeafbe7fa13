"""Newest frame of a vehicle's camera, as perception receives it."""

import time
from collections.abc import Callable

import zenoh

from dfvs_common.clock import local_clock
from dfvs_core.errors import ConfigError, DfvsError
from dfvs_core.geometry.camera import CameraModel
from dfvs_core.messages.frame import decode_frame, decode_header
from dfvs_service.command import operators_zenoh
from dfvs_service.frames import CapturedImage, RawSample
from dfvs_service.mailbox import Mailbox
from dfvs_service.perception.announced import await_camera
from dfvs_service.perception.frame_source import make_frame_source
from dfvs_service.settings.calibration_file import with_calibration
from dfvs_service.settings.config import ServiceConfig
from dfvs_service.zenoh_session import attachment_of, open_session, publisher_of


def open_beside(config: ServiceConfig) -> zenoh.Session:
    """Session beside a running service, or in its place where none runs.

    Raises
    ------
    ConfigError
        If neither can be opened.
    """
    try:
        return open_session(operators_zenoh(config.zenoh))
    except ConfigError:
        if config.zenoh.mode == "client":
            raise
        return open_session(config.zenoh)


def known_camera(
    config: ServiceConfig, remedy: str = "make one with dfvs-camera calibrate"
) -> CameraModel:
    """Calibration by the settings, or as the camera announces it.

    Parameters
    ----------
    config : ServiceConfig
    remedy : str
        How to have a calibration, for the error.

    Raises
    ------
    ConfigError
        If neither tells it.
    """
    camera = with_calibration(config).camera.model() or await_camera(config, open_beside)
    wait_s = config.camera.announced_s
    if camera is None and wait_s > 0:
        key = make_frame_source(config, local_clock()).calibration_key
        raise ConfigError(
            f"no camera announced its calibration on {key} within {wait_s:g} s",
            "one that runs and is calibrated, or a calibration in the settings' [camera] section",
            remedy,
        )
    if camera is None:
        raise ConfigError(
            "nothing is known of the camera's lens",
            "a calibration in the settings' [camera] section",
            f"{remedy}, or set camera.announced_s",
        )
    return camera


class FrameQueue:
    """Takes frames from Zenoh, of our own cameras or of ROS 2.

    ``log`` takes a line for the user about a frame that cannot be read, once each.
    """

    ended = False

    def __init__(
        self, session: zenoh.Session, config: ServiceConfig, log: Callable[[str], None]
    ) -> None:
        self.clock = local_clock()
        self.source = make_frame_source(config, self.clock)
        self.key = self.source.key
        """Where frames are awaited."""
        self._mailbox: Mailbox[RawSample] = Mailbox()
        self._log = log
        self._last_problem = ""
        # The subscription lives as long as the reference to it.
        self._subscriber: zenoh.Subscriber[None] | None = session.declare_subscriber(
            self.key, self._on_sample
        )

    def _on_sample(self, sample: zenoh.Sample) -> None:
        payload, attachment = sample.payload.to_bytes(), attachment_of(sample)
        self._mailbox.put(RawSample(payload, attachment, time.monotonic_ns(), publisher_of(sample)))

    def receive_sample(self, timeout_s: float) -> RawSample | None:
        """Newest sample in our own wire format, None if none came that can be read."""
        sample = self._mailbox.get(timeout_s)
        if sample is None:
            return None
        try:
            return self.source.translate(sample)
        except DfvsError as error:
            self._complain(error)
            return None

    def receive(self, timeout_s: float) -> CapturedImage | None:
        """Newest frame, decoded."""
        sample = self.receive_sample(timeout_s)
        if sample is None:
            return None
        try:
            frame = decode_frame(sample.payload, decode_header(sample.attachment))
        except DfvsError as error:
            self._complain(error)
            return None
        return CapturedImage(frame.image, frame.t_capture_ns)

    def close(self) -> None:
        """Listen no more."""
        self._subscriber = None

    def _complain(self, error: DfvsError) -> None:
        if str(error) != self._last_problem:
            self._last_problem = str(error)
            self._log(f"a frame cannot be read: {error}")
