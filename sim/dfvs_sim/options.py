"""Command-line options that several commands share: the scene, the camera, a file of figures."""

from __future__ import annotations

import argparse
import json
import math
from pathlib import Path
from typing import Any

from dfvs_core.errors import ConfigError
from dfvs_core.geometry.camera import CameraModel


def add_scene_option(parser: argparse.ArgumentParser) -> None:
    """Add ``--scene``."""
    parser.add_argument(
        "--scene", type=Path, metavar="FILE.glb", help="scene to see (default: the built-in room)"
    )


def add_camera_options(
    parser: argparse.ArgumentParser, size: str = "320x240", what: str = "picture size in px"
) -> None:
    """Add ``--size``, with its default and help, and ``--fov``."""
    help_text = f"{what} (default: %(default)s)"
    parser.add_argument("--size", default=size, metavar="WxH", help=help_text)
    parser.add_argument(
        "--fov", type=float, default=75.0, metavar="DEG", help="horizontal field of view"
    )


def camera_from(args: argparse.Namespace, option: str = "--size") -> CameraModel:
    """Camera of ``--size``, or what it is called, and ``--fov``.

    Raises
    ------
    ConfigError
        If the size is none.
    """
    width, _, height = args.size.lower().partition("x")
    if not (width.isdecimal() and height.isdecimal()):
        raise ConfigError(f"{option} is {args.size!r}", "WIDTHxHEIGHT such as 320x240")
    return CameraModel.from_horizontal_fov(int(width), int(height), math.radians(args.fov))


def require_folder(option: str, path: Path | None) -> None:
    """Refuse a file that an option names in a folder that does not exist; None is no file.

    Raises
    ------
    ConfigError
        If it does not.
    """
    if path is not None and not path.absolute().parent.is_dir():
        raise ConfigError(f"{option} {path} lies in no folder", "an existing folder")


def write_json(path: Path, document: Any) -> None:
    """Write what ``--json`` asks for.

    Raises
    ------
    ConfigError
        If the file cannot be written.
    """
    try:
        path.write_text(json.dumps(document, indent=2) + "\n", encoding="utf-8")
    except OSError as error:
        raise ConfigError(
            f"--json {path} cannot be written ({error.strerror})", "a file in an existing folder"
        ) from error
