"""``dfvs-camera goal``: take a goal image with its sidecar."""

import argparse
import contextlib
import math
import time
from collections.abc import Iterator, Sequence
from pathlib import Path

import cv2

from dfvs_common.command_line import command_parser, require_range, require_replaceable
from dfvs_common.goal_file import write_goal
from dfvs_core.errors import ConfigError
from dfvs_core.messages.goal import Mount
from dfvs_core.perception.frame_validator import check_content
from dfvs_core.perception.vehicle_history import Motion, VehicleHistory
from dfvs_service.camera.feed import Feed
from dfvs_service.camera.options import (
    add_calibration_option,
    add_source_options,
    calibration_of,
    feed_of,
    log,
    refuse_source_options,
)
from dfvs_service.camera.sources.source import check_size
from dfvs_service.camera.sources.spec import CameraError
from dfvs_service.frames import CapturedImage
from dfvs_service.route.frame_queue import FrameQueue, known_camera, open_beside
from dfvs_service.route.vehicle_state import VehicleStateListener
from dfvs_service.settings.config import ServiceConfig
from dfvs_service.settings.goal_file import sidecar_of
from dfvs_service.settings.options import add_settings_options, settings_from

ZENOH = "zenoh"
_RECEIVE_S = 0.25
_CALIBRATION = "give --calibration FILE, which dfvs-camera calibrate writes"
_EPILOG = """\
examples:
  dfvs-camera goal --source 0 --calibration camera.toml --config service.toml \\
      --mavlink udpin://127.0.0.1:14540 --out goal.png
  dfvs-camera goal --source zenoh --calibration camera.toml --config service.toml \\
      --attitude 0,-2.5 --out goal.png

--source zenoh takes the image from the camera that publishes for the service. Without
--calibration that of the settings counts, else the one that the camera announces
(camera.announced_s). Of several usable images the sharpest is kept. Exit code: 0 done, 2 cannot
run.
"""


def _parser() -> argparse.ArgumentParser:
    parser = command_parser(
        "dfvs-camera goal",
        "Take a goal image, with a sidecar of calibration, attitude and time.",
        _EPILOG,
    )
    add_source_options(parser)
    add_calibration_option(parser)
    add_settings_options(parser)
    parser.add_argument("--mavlink", metavar="URL", help="take the attitude from this autopilot")
    parser.add_argument("--attitude", metavar="ROLL,PITCH", help="or give it, in degrees")
    parser.add_argument(
        "--frames", type=int, default=5, metavar="N", help="images to choose from (default: 5)"
    )
    parser.add_argument("--timeout", type=float, default=20.0, metavar="S", help="(default: 20)")
    parser.add_argument("--out", type=Path, required=True, metavar="FILE", help="PNG to write")
    return parser


def run(words: Sequence[str]) -> int:
    """Take a goal; exit code 0.

    Raises
    ------
    DfvsError
        If there is no image, calibration or attitude, or the goal cannot be written.
    """
    arguments = _parser().parse_args(words)
    require_replaceable("--out", arguments.out, ".png")
    require_range(arguments, 1, 1000, "frames")
    require_range(arguments, 0.1, 3600, "timeout")
    given = None if arguments.attitude is None else parse_attitude(arguments.attitude)
    if given is not None and arguments.mavlink is not None:
        raise ConfigError("--attitude beside --mavlink", "only one of them")
    if arguments.source == ZENOH:
        refuse_source_options(arguments, "--source zenoh")
    config = settings_from(arguments)
    camera = calibration_of(arguments) or known_camera(config, _CALIBRATION)
    listener: VehicleStateListener | None = None
    if arguments.mavlink is not None:
        listener = VehicleStateListener(attitude_only=True)
        listener.connect(arguments.mavlink, config.vehicle.timeout_s, config.vehicle.system_id)
    with _feed(arguments, config, camera.size) as feed:
        captured, motion = _sharpest(feed, listener, arguments.frames, arguments.timeout)
    check_size(captured.image, camera.size, "the source")
    if listener is None:
        motion = given
        if given is None:
            log("the vehicle counts as level: neither --mavlink nor --attitude was given")
    if config.camera.mount is None:
        log("the camera counts as mounted straight ahead: no camera.mount")
    sidecar = sidecar_of(camera, config.camera.mount or Mount(), motion)
    write_goal(arguments.out, captured.image, sidecar)
    print(f"wrote {arguments.out} and {arguments.out.with_suffix('.json')}")
    return 0


def parse_attitude(text: str) -> Motion:
    """Attitude at rest from ``ROLL,PITCH`` in degrees.

    Raises
    ------
    ConfigError
        If it is none.
    """
    try:
        roll, pitch = (math.radians(float(part)) for part in text.split(","))
    except ValueError as error:
        raise ConfigError(f"--attitude is {text!r}", "ROLL,PITCH in degrees") from error
    if not (abs(roll) <= math.pi / 2 and abs(pitch) <= math.pi / 2):
        raise ConfigError(f"--attitude is {text!r}", "angles of up to 90 degrees")
    return Motion.at_rest(roll, pitch)


@contextlib.contextmanager
def _feed(
    arguments: argparse.Namespace, config: ServiceConfig, size: tuple[int, int]
) -> Iterator[Feed]:
    """Images of ``--source``, or of the camera that publishes for the service."""
    if arguments.source != ZENOH:
        with contextlib.closing(feed_of(arguments, size)) as feed:
            yield feed
        return
    with open_beside(config) as session:
        frames = FrameQueue(session, config, log)
        log(f"waiting for frames on {frames.key}")
        yield frames


def _sharpest(
    feed: Feed, listener: VehicleStateListener | None, count: int, timeout_s: float
) -> tuple[CapturedImage, Motion | None]:
    """Sharpest of so many usable images, and the vehicle's motion when it was taken."""
    history = VehicleHistory()
    problem = CameraError(f"no image within {timeout_s:g} s", "a camera that works")
    best: tuple[float, CapturedImage, Motion | None] | None = None
    seen, deadline = 0, time.monotonic() + timeout_s
    while seen < count and not feed.ended and time.monotonic() < deadline:
        captured = feed.receive(_RECEIVE_S)
        for state in [] if listener is None else listener.new_states():
            history.add(state)
        if captured is None:
            continue
        fault = check_content(captured.image)
        if fault is not None:
            problem = CameraError(f"no goal was taken: {fault.value}", "an image with contrast")
            continue
        motion = history.at(captured.t_capture_ns)
        if listener is not None and motion is None:
            problem = CameraError(
                "the attitude is not known at the time of any image",
                "ATTITUDE_QUATERNION from the autopilot",
                "check the MAVLink mode of its port, or give --attitude",
            )
            continue
        seen += 1
        sharpness = sharpness_of(captured)
        if best is None or sharpness > best[0]:
            best = sharpness, captured, motion
    if best is None:
        raise problem
    return best[1], best[2]


def sharpness_of(captured: CapturedImage) -> float:
    """Variance of the Laplacian: the higher, the sharper."""
    grey = cv2.cvtColor(captured.image, cv2.COLOR_RGB2GRAY)
    return float(cv2.Laplacian(grey, cv2.CV_32F).var())
