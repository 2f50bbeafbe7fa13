"""Command-line options that several commands share: scene, camera, poses, conditions, files."""

import argparse
import math
import re
from pathlib import Path
from typing import Any

from dfvs_common.atomic_file import replace_json
from dfvs_common.command_line import parse_size
from dfvs_core.errors import ConfigError
from dfvs_core.geometry.arrays import FloatArray
from dfvs_core.geometry.camera import CameraModel
from dfvs_sim.dynamics.estimate_errors import EstimateGrade
from dfvs_sim.dynamics.wind import WindGrade
from dfvs_sim.render.renderer import Renderer
from dfvs_sim.scene import builtin_room_path
from dfvs_sim.scene.glb import load_glb
from dfvs_sim.viewpoints.poses import camera_pose


def add_scene_option(parser: argparse.ArgumentParser) -> None:
    """Add ``--scene``."""
    parser.add_argument(
        "--scene", type=Path, metavar="FILE.glb", help="scene to see (default: the built-in room)"
    )


def renderer_from(args: argparse.Namespace) -> Renderer:
    """Renderer of ``--scene``."""
    return Renderer(load_glb(args.scene or builtin_room_path()))


def add_camera_options(
    parser: argparse.ArgumentParser, size: str = "320x240", what: str = "image size in px"
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
    return CameraModel.from_horizontal_fov(*parse_size(args.size, option), math.radians(args.fov))


def parse_numbers(
    text: str, option: str, count: int, expected: str = "", remedy: str = ""
) -> tuple[float, ...]:
    """Finite numbers that are separated by commas.

    Raises
    ------
    ConfigError
        If the text is not so many numbers.
    """
    try:
        values = tuple(float(part) for part in text.split(","))
    except ValueError:
        values = ()
    if len(values) != count or not all(map(math.isfinite, values)):
        expected = expected or f"{count} numbers separated by commas"
        raise ConfigError(f"{option} is {text!r}", expected, remedy)
    return values


def parse_seeds(text: str, option: str, expected: str) -> range:
    """Seeds A to B of ``A-B``, or the one of ``A``.

    Raises
    ------
    ConfigError
        If the text is neither.
    """
    match = re.fullmatch(r"(\d{1,9})(?:-(\d{1,9}))?", text)
    first, last = (int(match[1]), int(match[2] or match[1])) if match else (1, 0)
    if last < first:
        raise ConfigError(f"{option} is {text!r}", expected)
    return range(first, last + 1)


def parse_camera_pose(text: str, option: str) -> FloatArray:
    """``T_scene_camera`` (4, 4) of a level camera from ``X,Y,Z,YAW`` (NED, m and degrees).

    Raises
    ------
    ConfigError
        If the text is not four finite numbers.
    """
    expected = "X,Y,Z,YAW: north, east, down in m and heading in degrees"
    remedy = f"for instance {option} 0.5,-1,-1.3,40"
    x, y, z, yaw_deg = parse_numbers(text, option, 4, expected, remedy)
    return camera_pose((x, y, z), math.radians(yaw_deg))


def grade_names(grades: type[EstimateGrade] | type[WindGrade]) -> str:
    """Names of all grades, separated by commas."""
    return ", ".join(grade.value for grade in grades)


def parse_estimate(name: str) -> EstimateGrade:
    """Grade of ``--estimate``.

    Raises
    ------
    ConfigError
        If there is no such grade.
    """
    try:
        return EstimateGrade(name)
    except ValueError as error:
        expected = f"one of {grade_names(EstimateGrade)}"
        raise ConfigError(f"--estimate is {name!r}", expected) from error


def parse_wind(text: str) -> tuple[WindGrade, tuple[float, float]]:
    """Grade of wind with gusts, and steady wind towards north and east (m/s), of ``--wind``.

    Raises
    ------
    ConfigError
        If it is neither a grade nor two numbers.
    """
    if any(text == grade.value for grade in WindGrade):
        return WindGrade(text), (0.0, 0.0)
    expected = f"one of {grade_names(WindGrade)}, or two numbers separated by a comma"
    north, east = parse_numbers(text, "--wind", 2, expected)
    return WindGrade.CALM, (north, east)


def write_json(path: Path, document: Any) -> None:
    """Write what ``--json`` asks for, whole or not at all.

    Raises
    ------
    ConfigError
        If the file cannot be written.
    ValueError
        If a number is not finite: JSON has none such, and None stands for what is unknown.
    """
    try:
        replace_json(path, document)
    except OSError as error:
        raise ConfigError(
            f"--json {path} cannot be written ({error.strerror})", "a file in an existing folder"
        ) from error
