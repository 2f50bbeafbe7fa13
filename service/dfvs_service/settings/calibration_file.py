"""Calibration of a camera as a settings file.

It holds the ``[camera]`` section of the service's settings and nothing else, so it can be given
as ``--config``, copied into a larger file, or named there as ``camera.calibration_file``.
"""

import dataclasses
from collections.abc import Sequence
from pathlib import Path

from dfvs_common.atomic_file import replace_file
from dfvs_core.errors import ConfigError
from dfvs_core.geometry.camera import CameraModel
from dfvs_service.settings.config import ServiceConfig, load_config

_EXPECTED = "a TOML file: [camera] with width, height, fx, fy, cx, cy"
_REMEDY = (
    "make one with dfvs-camera calibrate, or copy another program's numbers into one "
    "(Cameras, An existing calibration)"
)


def write_calibration(path: Path, camera: CameraModel, remarks: Sequence[str]) -> None:
    """Write a calibration, complete or not at all, with remarks as comments.

    Raises
    ------
    ConfigError
        If the file cannot be written.
    """
    numbers = ", ".join(repr(float(value)) for value in camera.distortion)
    lines = [
        *(f"# {remark}" for remark in remarks),
        "[camera]",
        f"width = {camera.width}",
        f"height = {camera.height}",
        *(f"{name} = {float(getattr(camera, name))!r}" for name in ("fx", "fy", "cx", "cy")),
        f"distortion = [{numbers}]",
    ]
    replace_file(path, ("\n".join(lines) + "\n").encode())


def read_calibration(path: Path) -> CameraModel:
    """Camera of a settings file with a ``[camera]`` section.

    Raises
    ------
    ConfigError
        If it cannot be read or holds no intrinsics.
    """
    try:
        camera = load_config(path, {}).camera.model()
    except ConfigError as error:
        raise ConfigError(
            error.problem, error.expected or _EXPECTED, error.remedy or _REMEDY
        ) from error
    if camera is None:
        raise ConfigError(f"{path} holds no calibration", _EXPECTED, _REMEDY)
    return camera


def with_calibration(config: ServiceConfig) -> ServiceConfig:
    """Settings in which ``camera.calibration_file``, where one is named, has been read.

    Raises
    ------
    ConfigError
        If the file cannot be used, or the settings hold other intrinsics as well.
    """
    section = config.camera
    if not section.calibration_file:
        return config
    if section.model() is not None:
        raise ConfigError("camera has both a calibration_file and intrinsics", "only one of them")
    camera = read_calibration(Path(section.calibration_file))
    return with_intrinsics(config, camera, section.calibration_file)


def with_intrinsics(
    config: ServiceConfig, camera: CameraModel, origin: str = "the camera"
) -> ServiceConfig:
    """Settings with a camera's intrinsics; ``origin`` is their source.

    Raises
    ------
    ConfigError
        If the settings name another size.
    """
    section = config.camera
    for name, given, read in (
        ("width", section.width, camera.width),
        ("height", section.height, camera.height),
    ):
        if given not in (None, read):
            raise ConfigError(f"camera.{name} is {given}", f"{read}, as {origin} says")
    return dataclasses.replace(config, camera=section.with_model(camera))
