"""``dfvs-camera``: publish a camera, a stream, a video or images to the service."""

import argparse
import contextlib
import json
import time
from collections.abc import Sequence

from dfvs_common.command_line import program_parser, require_range
from dfvs_common.lifecycle import stop_event
from dfvs_core.errors import ConfigError
from dfvs_core.messages.frame import FORMAT_NAMES
from dfvs_core.messages.topics import Topics
from dfvs_service.camera.options import (
    add_calibration_option,
    add_source_options,
    calibration_of,
    cameras_zenoh,
    feed_of,
    log,
    source_options,
)
from dfvs_service.camera.publisher import (
    JPEG_QUALITY,
    FramePublisher,
    PublishOptions,
    publish_feed,
)
from dfvs_service.settings.options import add_settings_options, settings_from
from dfvs_service.zenoh_session import open_persistently

_EPILOG = """\
examples:
  dfvs-camera --source 0 --size 640x480 --rate 30 --calibration camera.toml
  dfvs-camera --source rtsp://192.168.144.25:8554/main.264 --latency-ms 120
  dfvs-camera --source flight.mp4 --loop

other commands:
  dfvs-camera board      draw a calibration board, ready to be printed
  dfvs-camera calibrate  find the camera's intrinsics from images of a board
  dfvs-camera goal       take a goal image with its sidecar

A live source that is lost is opened again every second. Exit code: 0 ended, 2 cannot run.
"""


def parser() -> argparse.ArgumentParser:
    """Options of publishing."""
    made = program_parser(
        "dfvs-camera",
        "Publish images to the service: JPEG or raw, with the time of capture and "
        "the camera's calibration.",
        _EPILOG,
    )
    add_source_options(made)
    add_calibration_option(made)
    add_settings_options(made)
    made.add_argument(
        "--connect",
        metavar="ENDPOINT",
        help="Zenoh endpoint of the service (default: what the settings say it listens on)",
    )
    made.add_argument(
        "--format", choices=sorted(FORMAT_NAMES), default="jpeg", help="(default: jpeg)"
    )
    made.add_argument(
        "--quality", type=int, metavar="Q", help=f"of JPEG, 1 to 100 (default: {JPEG_QUALITY})"
    )
    made.add_argument("--frames", type=int, metavar="N", help="end after N frames")
    made.add_argument(
        "--require-subscriber",
        type=float,
        nargs="?",
        const=10.0,
        metavar="S",
        help="end with exit code 2 when nobody receives for so long (default: 10)",
    )
    made.add_argument("--json", action="store_true", help="print what was published at the end")
    return made


def run(words: Sequence[str]) -> int:
    """Publish until interrupted or until a recording ends; exit code 0.

    Raises
    ------
    DfvsError
        If the source or an option cannot be used.
    """
    arguments = parser().parse_args(words)
    options = _publish_options(arguments)
    stop = stop_event()
    started_s = time.monotonic()
    with contextlib.closing(feed_of(arguments, options.wanted_size)) as feed:
        section = cameras_zenoh(settings_from(arguments).zenoh, arguments.connect)
        session = open_persistently(section, stop.is_set, log)
        if session is None:
            return 0
        with session:
            publisher = FramePublisher(session, options)
            log(f"publishing on {Topics(options.vehicle).camera}")
            publish_feed(feed, publisher, options, stop, log)
    if arguments.json:
        summary = {
            "frames": publisher.count,
            "bytes": publisher.bytes,
            "seconds": round(time.monotonic() - started_s, 3),
        }
        print(json.dumps(summary))
    return 0


def _publish_options(arguments: argparse.Namespace) -> PublishOptions:
    require_range(arguments, 1, 100, "quality")
    require_range(arguments, 1, None, "frames")
    if arguments.quality is not None and arguments.format != "jpeg":
        raise ConfigError(f"--quality beside --format {arguments.format}", "--format jpeg")
    required_s = arguments.require_subscriber
    if required_s is not None and not 0.0 < required_s <= 3600.0:
        raise ConfigError(f"--require-subscriber is {required_s:g}", "above 0, to 3600 s")
    camera = calibration_of(arguments)
    asked = source_options(arguments, camera.size if camera else None)
    return PublishOptions(
        vehicle=settings_from(arguments).vehicle.name,
        pixel_format=FORMAT_NAMES[arguments.format],
        quality=JPEG_QUALITY if arguments.quality is None else arguments.quality,
        camera=camera,
        size=asked.size,
        max_frames=arguments.frames,
        required_subscriber_s=required_s,
    )
