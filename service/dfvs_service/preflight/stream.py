"""Rate, size and announced calibration of the live camera."""

import time
from collections.abc import Callable
from dataclasses import dataclass

from dfvs_core.errors import DfvsError
from dfvs_core.gate.checks.preflight import Check
from dfvs_core.gate.config import S
from dfvs_core.messages.frame import decode_header
from dfvs_core.messages.goal import Goal
from dfvs_service.frames import RawSample
from dfvs_service.perception.announced import CameraDoubts, open_as_service, subscribe_calibration
from dfvs_service.route.frame_queue import FrameQueue
from dfvs_service.settings.config import ServiceConfig

_PATIENCE_NS = 4 * S
"""For the first frame: a camera that lost its service connects again within seconds."""
_LISTEN_NS = S
_RECEIVE_S = 0.05
_NAME = "stream"
_DOUBTFUL = "give service and camera the same calibration"


@dataclass(frozen=True, slots=True)
class Stream:
    """What came from a camera: size (width, height) px of the newest frame, and frames a second."""

    size: tuple[int, int]
    rate_hz: float


def stream_checks(config: ServiceConfig, goal: Goal) -> tuple[Check, ...]:
    """Listen to the camera for a second, in the service's place.

    Raises
    ------
    ConfigError
        If Zenoh cannot be opened.
    """
    camera = config.camera.model() or goal.sidecar.camera
    refusals: list[str] = []
    doubts: list[str] = []
    with open_as_service(config) as session:
        frames = FrameQueue(session, config, refusals.append)
        # Closing the session ends the subscription; the reference keeps it until then.
        _calibration = subscribe_calibration(
            session, frames.source, CameraDoubts(camera, doubts.append).on_camera
        )
        stream = listen(lambda: frames.receive_sample(_RECEIVE_S), time.monotonic_ns)
        frames.close()
    if stream is None and refusals:
        check = Check(_NAME, False, refusals[0], f"see what publishes on {frames.key}")
    else:
        check = judge(stream, camera.size, config.gate.min_frame_hz)
    announced = (Check("announced", False, doubt, _DOUBTFUL, binding=False) for doubt in doubts)
    return (check, *announced)


def listen(take: Callable[[], RawSample | None], tick: Callable[[], int]) -> Stream | None:
    """Take frames for a second from the first one on; None where none comes.

    ``take`` gives the newest sample in our own wire format, None after a moment without; ``tick``
    gives monotonic ns.
    """
    end_ns = tick() + _PATIENCE_NS
    arrivals: list[int] = []
    size = (0, 0)
    while tick() < end_ns:
        sample = take()
        if sample is None:
            continue
        try:
            header = decode_header(sample.attachment)
        except DfvsError:  # perception refuses it as well, with the reason
            continue
        if not arrivals:
            end_ns = sample.t_arrival_ns + _LISTEN_NS
        arrivals.append(sample.t_arrival_ns)
        size = (header.width, header.height)
    if not arrivals:
        return None
    took_ns = arrivals[-1] - arrivals[0]
    return Stream(size, (len(arrivals) - 1) * S / took_ns if took_ns else 0.0)


def judge(stream: Stream | None, size: tuple[int, int], min_frame_hz: float) -> Check:
    """Check that a stream has the size that is expected, and frames as often as are needed.

    Silence is not judged: the check ``frames`` waits longer for a camera.
    """
    if stream is None:
        return Check(_NAME, True, f"no frame within {_PATIENCE_NS // S} s", pending=True)
    found = "{} x {} px".format(*stream.size) + f", {stream.rate_hz:.1f} frames a second"
    if stream.size != size:
        expected = "{} x {} px".format(*size)
        remedy = f"have the camera send {expected}, or take goal and calibration with this size"
        return Check(_NAME, False, f"{found}; {expected} expected", remedy)
    if stream.rate_hz < min_frame_hz:
        remedy = "give it more light, a smaller size, or a link that carries its frames"
        return Check(_NAME, False, f"{found}; {min_frame_hz:g} needed", remedy)
    return Check(_NAME, True, f"{found}, {min_frame_hz:g} needed")
