"""Command-line options that several commands share: the scene and the camera."""

from __future__ import annotations

import argparse
import math
from pathlib import Path

from dfvs_core.camera import CameraModel
from dfvs_core.errors import ConfigError


def add_scene_option(parser: argparse.ArgumentParser) -> None:
    """Add ``--scene``."""
    parser.add_argument(
        "--scene", type=Path, metavar="FILE.glb", help="scene to see (default: the built-in room)"
    )


def add_camera_options(parser: argparse.ArgumentParser) -> None:
    """Add ``--size`` and ``--fov``."""
    parser.add_argument("--size", default="320x240", metavar="WxH", help="picture size in px")
    parser.add_argument(
        "--fov", type=float, default=75.0, metavar="DEG", help="horizontal field of view"
    )


def camera_from(args: argparse.Namespace) -> CameraModel:
    """Camera of ``--size`` and ``--fov``.

    Raises
    ------
    ConfigError
        If the size is none.
    """
    width, _, height = args.size.lower().partition("x")
    if not (width.isdecimal() and height.isdecimal()):
        raise ConfigError(f"--size is {args.size!r}", "WIDTHxHEIGHT such as 320x240")
    return CameraModel.from_horizontal_fov(int(width), int(height), math.radians(args.fov))
