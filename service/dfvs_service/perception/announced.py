"""Calibration that cameras announce."""

import queue
from collections.abc import Callable

import zenoh
import zenoh.ext

from dfvs_common.clock import local_clock
from dfvs_common.progress import warn
from dfvs_core.errors import DfvsError, WireError
from dfvs_core.geometry.camera import CameraModel, calibration_difference
from dfvs_core.messages.goal_command import MAX_SIDECAR_BYTES
from dfvs_service.perception.frame_source import FrameSource, make_frame_source
from dfvs_service.settings.config import ServiceConfig
from dfvs_service.zenoh_session import open_session, subscribe_kept

_MOST_WARNINGS = 8

OnCamera = Callable[[CameraModel | DfvsError], None]


class CameraDoubts:
    """Warns, once each, of announcements of another camera than the flight's."""

    def __init__(self, camera: CameraModel, warn: Callable[[str], None] = warn) -> None:
        self._camera = camera
        self._warn = warn
        self._reported: set[str] = set()

    def on_camera(self, announced: CameraModel | DfvsError) -> None:
        """Take an announcement, on any thread."""
        if isinstance(announced, DfvsError):
            problem = str(announced)
        else:
            problem = calibration_difference(self._camera, announced, "announced")
        if problem and problem not in self._reported and len(self._reported) < _MOST_WARNINGS:
            self._reported.add(problem)
            self._warn(problem)


def subscribe_calibration(
    session: zenoh.Session, source: FrameSource, on_camera: OnCamera
) -> zenoh.ext.AdvancedSubscriber[None]:
    """Call back, on Zenoh's thread, for every calibration or what is wrong with it.

    One that was announced before is asked for. A camera that is not calibrated is passed over.
    """

    def on_sample(sample: zenoh.Sample) -> None:
        try:
            if (size := len(sample.payload)) > MAX_SIDECAR_BYTES:
                raise WireError(f"calibration of {size} bytes", f"at most {MAX_SIDECAR_BYTES}")
            camera = source.camera(sample.payload.to_bytes())
        except DfvsError as error:
            on_camera(error)
            return
        if camera is not None:
            on_camera(camera)

    return subscribe_kept(session, source.calibration_key, on_sample)


def open_as_service(config: ServiceConfig) -> zenoh.Session:
    """Session of the service itself, which listens where its settings say.

    Raises
    ------
    ConfigError
        If it cannot be opened, such as where another service runs.
    """
    return open_session(config.zenoh, (config.vehicle.name,))


def await_camera(
    config: ServiceConfig, open_link: Callable[[ServiceConfig], zenoh.Session] = open_as_service
) -> CameraModel | None:
    """Camera that announces itself within ``camera.announced_s``, None if none does.

    ``open_link`` opens the session to listen on.

    Raises
    ------
    DfvsError
        If what it announces cannot be used, or Zenoh cannot be opened.
    """
    if config.camera.announced_s <= 0:
        return None
    source = make_frame_source(config, local_clock())
    announcements: queue.Queue[CameraModel | DfvsError] = queue.Queue()
    with open_link(config) as session:
        # Closing the session ends the subscription; the reference keeps it until then.
        _subscriber = subscribe_calibration(session, source, announcements.put)
        try:
            announced = announcements.get(timeout=config.camera.announced_s)
        except queue.Empty:
            return None
    if isinstance(announced, DfvsError):
        raise announced
    return announced
