"""The mock camera's loop: pose from the vehicle's telemetry, image from the renderer."""

import os
import threading
import time
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import zenoh

from dfvs_common.clock import local_clock
from dfvs_core.geometry.camera import CameraModel
from dfvs_core.messages.frame import Frame, PixelFormat, check_frame_size, encode_frame
from dfvs_core.messages.topics import Topics
from dfvs_sim.camera.sensor import SensorNoise
from dfvs_sim.render.renderer import Renderer
from dfvs_sim.viewpoints.poses import CameraPoses

_LONGEST_LEAD_NS = 100_000_000
_LEAD_SHARE = 0.1
"""Share of the last image in the estimate of how long one takes."""
_REMEMBERED = 1024

Publish = Callable[[bytes, bytes, str], None]
"""Takes payload, attachment and the encoding's name of a frame."""


@dataclass(frozen=True, slots=True)
class MockCameraConfig:
    """What the mock camera is like; ``noise`` is in grey levels.

    ``nice`` is how far its thread gives way: a real camera takes no processor from the service.
    """

    camera: CameraModel
    rate_hz: float = 20.0
    pixel_format: PixelFormat = PixelFormat.JPEG
    noise: float = 1.5
    seed: int = 0
    nice: int = 0


class MockCamera:
    """Renders and publishes frames until stopped.

    An image shows the moment at which it is ready, by the pose predicted for then: how long a
    machine renders is no latency of the camera, up to a tenth of a second. ``poses`` come from the
    vehicle's MAVLink telemetry, as beside a real autopilot; ``publish`` takes payload, attachment
    and the encoding's name.
    """

    def __init__(
        self,
        config: MockCameraConfig,
        renderer: Renderer,
        poses: CameraPoses,
        publish: Publish,
    ) -> None:
        self._config = config
        self._renderer = renderer
        self._poses = poses
        self._publish = publish
        self._rng = np.random.default_rng(config.seed)
        self._noise = SensorNoise.make(config.camera.size, config.noise, self._rng)
        self._clock = local_clock()
        self._lead_ns = 0
        self.frames = 0
        self.published_ns: deque[int] = deque(maxlen=_REMEMBERED)
        """When the last images were published, monotonic."""

    def run(self, stop: threading.Event) -> None:
        """Publish at the configured rate; a frame that comes too late is left out."""
        me = threading.get_native_id()
        os.setpriority(os.PRIO_PROCESS, me, os.getpriority(os.PRIO_PROCESS, me) + self._config.nice)
        period_ns = round(1e9 / self._config.rate_hz)
        due_ns = time.monotonic_ns()
        while not stop.wait(max(due_ns - time.monotonic_ns(), 0) * 1e-9):
            try:
                self.capture(time.monotonic_ns() + self._lead_ns)
            except zenoh.ZError:
                if not stop.is_set():
                    raise
                return  # the session was closed while an image was rendered
            due_ns = max(due_ns + period_ns, time.monotonic_ns())

    def capture(self, t_ns: int) -> None:
        """Render the image of time t_ns, not before it, and publish it, if the pose is known.

        Raises
        ------
        ImageError
            If the frame is too large for a message.
        """
        begun_ns = time.monotonic_ns()
        T_scene_camera = self._poses(t_ns)
        if T_scene_camera is None:
            return
        image = self._renderer.render(self._config.camera, T_scene_camera).image
        image = self._noise.apply(image, self._rng)
        frame = Frame(image, t_ns, self.frames)
        payload, attachment = encode_frame(frame, self._config.pixel_format, self._clock)
        check_frame_size(payload)
        taken_ns = time.monotonic_ns() - begun_ns
        lead_ns = self._lead_ns + _LEAD_SHARE * (taken_ns - self._lead_ns)
        self._lead_ns = min(round(lead_ns), _LONGEST_LEAD_NS)
        time.sleep(max(t_ns - time.monotonic_ns(), 0) * 1e-9)
        self._publish(payload, attachment, self._config.pixel_format.media_type)
        self.published_ns.append(time.monotonic_ns())
        self.frames += 1


def zenoh_publisher(session: zenoh.Session, vehicle: str) -> Publish:
    """Publish frames of a vehicle; a congested link drops them."""
    publisher = session.declare_publisher(
        Topics(vehicle).camera, congestion_control=zenoh.CongestionControl.DROP
    )

    def publish(payload: bytes, attachment: bytes, encoding: str) -> None:
        publisher.put(payload, encoding=encoding, attachment=attachment)

    return publish
