"""Reader of a goal's image and sidecar, and the sidecar of a goal that is captured in flight."""

import datetime
from collections.abc import Sequence
from pathlib import Path

from dfvs_common.file_order import numbered
from dfvs_core.errors import ConfigError, DfvsError, ImageError
from dfvs_core.geometry.arrays import ImageArray
from dfvs_core.geometry.camera import CameraModel, calibration_difference
from dfvs_core.messages.goal import Goal, GoalSidecar, Mount
from dfvs_core.messages.goal_command import GoalCommand
from dfvs_core.messages.image import MAX_IMAGE_BYTES, decode_image
from dfvs_core.perception.frame_validator import check_content
from dfvs_core.perception.vehicle_history import Motion
from dfvs_service.settings.runtime import RuntimeFolder

_SIDECAR = "JSON as dfvs-camera goal writes it"


def read_image(path: str | Path) -> ImageArray:
    """Read a PNG or JPEG file to (H, W, 3) uint8 RGB.

    EXIF orientation is not applied: pixels stay as the sensor had them, in its intrinsics' axes.
    Turn the pixels beforehand where they are to stand upright.

    Raises
    ------
    ImageError
        If the file is missing, too large, or not an image.

    Examples
    --------
    >>> import cv2, numpy as np
    >>> _ = cv2.imwrite("red.png", np.full((48, 64, 3), (0, 0, 255), np.uint8))  # OpenCV has BGR
    >>> image = read_image("red.png")
    >>> image.shape, image[0, 0].tolist()
    ((48, 64, 3), [255, 0, 0])
    >>> read_image("no-such-image.png")  # doctest: +ELLIPSIS
    Traceback (most recent call last):
    ...
    dfvs_core.errors.ImageError: cannot read the image no-such-image.png ...
    """
    try:
        with open(path, "rb") as file:
            data = file.read(MAX_IMAGE_BYTES + 1)
    except OSError as error:
        raise ImageError(
            f"cannot read the image {path} ({error.strerror})", "a PNG or JPEG file"
        ) from error
    try:
        return decode_image(data)
    except ImageError as error:
        raise ImageError(f"the image {path} cannot be used: {error}") from error


def read_sidecar(image_path: Path) -> GoalSidecar | None:
    """Sidecar of a goal image: the same name with ``.json``; None where there is none.

    Raises
    ------
    ConfigError
        If it is there but does not follow the format.
    """
    path = image_path.with_suffix(".json")
    try:
        text = path.read_text(encoding="utf-8")
    except FileNotFoundError:
        return None
    except (OSError, UnicodeDecodeError) as error:
        raise ConfigError(f"cannot read the goal's sidecar {path} ({error})", _SIDECAR) from error
    try:
        return GoalSidecar.from_json(text)
    except DfvsError as error:
        problem = f"the goal's sidecar {path} cannot be used: {error.problem}"
        raise ConfigError(problem, error.expected or _SIDECAR, error.remedy) from error


def load_goal(image_path: str | Path) -> Goal:
    """Goal from an image with a sidecar beside it, of the same size.

    Raises
    ------
    ImageError
        If the image cannot be read, has another size than in its sidecar, or shows nothing.
    ConfigError
        If there is no sidecar or it cannot be used.

    Examples
    --------
    >>> import cv2, numpy as np
    >>> _ = cv2.imwrite("goal.png", 255 * np.eye(48, 64, dtype=np.uint8))
    >>> from dfvs_core.geometry.camera import CameraModel
    >>> sidecar = GoalSidecar(CameraModel.from_horizontal_fov(64, 48, 1.2), pitch_rad=-0.1)
    >>> _ = Path("goal.json").write_text(sidecar.to_json())
    >>> load_goal("goal.png").sidecar.pitch_rad
    -0.1
    """
    image_path = Path(image_path)
    sidecar = read_sidecar(image_path)
    if sidecar is None:
        raise ConfigError(f"{image_path} has no sidecar", f"{image_path.with_suffix('.json')}")
    return checked_goal(image_path, read_image(image_path), sidecar)


def load_goals(runtime: RuntimeFolder) -> list[Goal]:
    """Goal of a runtime folder, and those that follow it.

    Raises
    ------
    DfvsError
        If one of them cannot be used.
    """
    return [load_goal(image_path) for image_path in (runtime.goal_image, *runtime.later_goals())]


def route_images(places: Sequence[Path]) -> list[Path]:
    """Images of a route: those that are named, and in place of a folder those in it, in order.

    Raises
    ------
    ConfigError
        If a folder holds none.
    """
    paths: list[Path] = []
    for place in places:
        inside = images_in(place) if place.is_dir() else [place]
        if not inside:
            raise ConfigError(f"the route folder {place} is empty", "PNG or JPEG files")
        paths += inside
    return paths


def images_in(folder: Path) -> list[Path]:
    """Images of a folder in the order of their names, numbers in these by their value."""
    images = (path for path in folder.iterdir() if is_image(path))
    return sorted(images, key=lambda path: (numbered(path), path.name))


def is_image(path: Path) -> bool:
    """Whether a file counts as an image, by its name."""
    return path.suffix.lower() in (".png", ".jpg", ".jpeg")


def checked_goal(path: Path, image: ImageArray, sidecar: GoalSidecar) -> Goal:
    """Goal, after it was found that the image has the size of its camera, and shows something.

    Raises
    ------
    ImageError
        If it has not, or is black, white or without contrast.
    """
    remedy = "take the goal with the camera that flies, or correct the camera's settings"
    sidecar.camera.check_size(image, f"the goal image {path}", remedy)
    if (fault := check_content(image)) is not None:
        raise ImageError(f"the goal image {path} cannot be matched: {fault.value}", "contrast")
    return Goal(image, sidecar)


def goal_command(image_path: Path) -> GoalCommand:
    """Goal image and its sidecar as they are sent to a running service.

    Raises
    ------
    ImageError
        If the image cannot be read, or is not of its sidecar's size.
    ConfigError
        If the sidecar cannot be used.
    """
    image, sidecar = read_image(image_path), read_sidecar(image_path)
    if sidecar is not None:
        checked_goal(image_path, image, sidecar)
    return GoalCommand(image_path.read_bytes(), "" if sidecar is None else sidecar.to_json())


def commanded_goal(command: GoalCommand, flown: GoalSidecar) -> Goal:
    """Goal of a command whose signature was verified; what its sidecar lacks is as in ``flown``.

    Raises
    ------
    ImageError
        If the image cannot be read, or is not of its camera's size.
    ConfigError
        If the sidecar cannot be used, or is of another camera than the one that flies.
    """
    image = decode_image(command.image)
    sidecar = GoalSidecar.from_json(command.sidecar, flown) if command.sidecar else flown
    if difference := calibration_difference(flown.camera, sidecar.camera, "goal's"):
        raise ConfigError(difference, "a goal of the camera that flies, with its calibration")
    return checked_goal(Path("new goal"), image, sidecar)


def sidecar_of(camera: CameraModel, mount: Mount, motion: Motion | None) -> GoalSidecar:
    """Sidecar of an image that is taken now; without a motion the vehicle counts as level."""
    now = datetime.datetime.now(datetime.UTC).isoformat(timespec="milliseconds")
    roll, pitch = (0.0, 0.0) if motion is None else (motion.roll_rad, motion.pitch_rad)
    return GoalSidecar(camera, roll, pitch, mount, taken_at=now)
