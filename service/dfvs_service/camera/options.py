"""Command-line options shared by the camera's commands."""

import argparse
import dataclasses
import os
from pathlib import Path

import cv2

from dfvs_common import progress
from dfvs_common.command_line import parse_size, require_range
from dfvs_core.errors import ConfigError
from dfvs_core.geometry.camera import CameraModel
from dfvs_service.camera.feed import Feed, LiveFeed, RecordedFeed
from dfvs_service.camera.sources.source import Source, SourceOptions, open_source
from dfvs_service.camera.sources.spec import STAMPED_ON_ARRIVAL, SourceKind, parse_source
from dfvs_service.settings.calibration_file import read_calibration
from dfvs_service.settings.sections import ZenohSection


def log(text: str) -> None:
    """Write a line to the user on standard error."""
    progress.log(f"camera: {text}")


def add_source_options(parser: argparse.ArgumentParser) -> None:
    """Add ``--source`` and how to open it."""
    parser.add_argument(
        "--source",
        required=True,
        metavar="SOURCE",
        help="0 or /dev/..., rtsp://..., gst:PIPELINE, picamera, a video, image or folder",
    )
    parser.add_argument("--size", metavar="WxH", help="image size to ask the camera for, px")
    parser.add_argument("--rate", type=float, metavar="HZ", help="images a second")
    parser.add_argument("--loop", action="store_true", help="repeat a recording for ever")
    parser.add_argument(
        "--latency-ms",
        type=float,
        default=0.0,
        metavar="MS",
        help="measured time from capture to arrival, where the source tells none (default: 0)",
    )


def refuse_source_options(arguments: argparse.Namespace, beside: str) -> None:
    """Refuse options of :func:`add_source_options` beside images that another process takes.

    Raises
    ------
    ConfigError
        Naming the first that was given.
    """
    for name, default in (("size", None), ("rate", None), ("loop", False), ("latency_ms", 0.0)):
        if getattr(arguments, name) != default:
            option = f"--{name.replace('_', '-')}"
            raise ConfigError(f"{option} beside {beside}", "an option of that camera's own process")


def add_calibration_option(parser: argparse.ArgumentParser) -> None:
    """Add ``--calibration``."""
    parser.add_argument(
        "--calibration", type=Path, metavar="FILE", help="what dfvs-camera calibrate wrote"
    )


def calibration_of(arguments: argparse.Namespace) -> CameraModel | None:
    """Calibration that was named, None where none was."""
    return None if arguments.calibration is None else read_calibration(arguments.calibration)


def source_options(arguments: argparse.Namespace, wanted: tuple[int, int] | None) -> SourceOptions:
    """How to open the source; ``wanted`` is the calibration's size.

    Raises
    ------
    ConfigError
        If an option is out of range or contradicts the calibration.
    """
    require_range(arguments, 0.1, 1000, "rate")
    require_range(arguments, 0, 1000, "latency_ms")
    size = wanted
    if arguments.size is not None:
        size = parse_size(arguments.size)
        if wanted not in (None, size):
            raise ConfigError(
                f"--size is {arguments.size}",
                f"{wanted[0]}x{wanted[1]}, the calibration's size" if wanted else "",
            )
    return SourceOptions(size, arguments.rate, round(arguments.latency_ms * 1e6))


def feed_of(arguments: argparse.Namespace, wanted: tuple[int, int] | None) -> Feed:
    """Images of ``--source``.

    Raises
    ------
    DfvsError
        If there is no such source, a recording cannot be opened, or an option is wrong.
    """
    options = source_options(arguments, wanted)
    spec = parse_source(arguments.source)
    if options.latency_ns and spec.kind not in STAMPED_ON_ARRIVAL:
        raise ConfigError(f"--latency-ms beside {spec}", "a source that tells no time of capture")
    if options.rate_hz and spec.kind in (SourceKind.STREAM, SourceKind.GSTREAMER):
        raise ConfigError(f"--rate beside {spec}", "a source that comes at no rate of its own")
    if arguments.loop and spec.is_live:
        raise ConfigError(f"--loop beside {spec}", "a video, an image or a folder of images")

    def opener() -> Source:
        return open_source(spec, options)

    if spec.is_live:
        return LiveFeed(opener, log)
    return RecordedFeed(opener, options.rate_hz, loop=arguments.loop)


def quiet_libraries() -> None:
    """Keep OpenCV and FFmpeg from writing beside our own words; to be called first."""
    os.environ.setdefault("OPENCV_FFMPEG_LOGLEVEL", "-8")
    cv2.utils.logging.setLogLevel(cv2.utils.logging.LOG_LEVEL_SILENT)


def cameras_zenoh(service: ZenohSection, connect: str | None) -> ZenohSection:
    """Settings with which a camera reaches the service: its router, or the service itself."""
    endpoints = service.reached_at if connect is None else (connect,)
    return dataclasses.replace(service, connect=endpoints, listen=())
