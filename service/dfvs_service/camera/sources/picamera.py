"""Image source of the Raspberry Pi's cameras through Picamera2."""

import contextlib
import time
from typing import Any

import numpy as np

from dfvs_service.camera.sources.source import SourceOptions
from dfvs_service.camera.sources.spec import CameraError, SourceLostError
from dfvs_service.frames import CapturedImage

_DEFAULT_SIZE = (640, 480)


class PicameraSource:
    """A camera of libcamera.

    Raises
    ------
    CameraError
        If Picamera2 is not installed or cannot be loaded, or there is no camera of that number.
    SourceLostError
        If the camera cannot be started right now.
    """

    def __init__(self, number: int, options: SourceOptions) -> None:
        try:
            from picamera2 import Picamera2  # type: ignore[import-not-found]
        except ImportError as error:
            raise CameraError(
                f"Picamera2 is not installed ({error})",
                "Raspberry Pi OS with python3-picamera2",
                "make the virtual environment with --system-site-packages",
            ) from error
        except ValueError as error:  # a module of the system that was built for another numpy
            raise CameraError(
                f"Picamera2 cannot be loaded ({error})",
                "modules that were built for this numpy",
                "install simplejpeg in the virtual environment: pip install -I simplejpeg",
            ) from error
        if number >= len(Picamera2.global_camera_info()):
            raise CameraError(f"there is no Pi camera {number}", "a camera that libcamera lists")
        self.rate_hz = options.rate_hz or 0.0
        controls = {} if options.rate_hz is None else {"FrameRate": options.rate_hz}
        # libcamera names formats by their order in memory read backwards: this one is RGB.
        main = {"size": options.size or _DEFAULT_SIZE, "format": "BGR888"}
        try:
            with contextlib.ExitStack() as on_failure:
                self._camera: Any = Picamera2(number)
                on_failure.callback(self._camera.close)
                configuration = self._camera.create_video_configuration(
                    main=main, controls=controls, queue=False
                )
                self._camera.configure(configuration)
                self._camera.start()
                on_failure.pop_all()
        except RuntimeError as error:
            raise SourceLostError(f"the Pi camera {number} cannot be started ({error})") from error

    def read(self) -> CapturedImage | None:
        """Wait for the next image; its time is that of the sensor's first row."""
        try:
            request = self._camera.capture_request()
        except RuntimeError as error:
            raise SourceLostError(f"the Pi camera gives no more images ({error})") from error
        try:
            image = np.ascontiguousarray(request.make_array("main"))
            sensor_ns = int(request.get_metadata()["SensorTimestamp"])
        finally:
            request.release()
        # The sensor's time counts from the boot, with suspended time.
        offset_ns = time.clock_gettime_ns(time.CLOCK_BOOTTIME) - time.monotonic_ns()
        return CapturedImage(image, sensor_ns - offset_ns)

    def close(self) -> None:
        """Give the camera back."""
        self._camera.close()
