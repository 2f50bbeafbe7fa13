"""Writing a goal's image and sidecar."""

from pathlib import Path

from dfvs_common.atomic_file import replace_file
from dfvs_core.errors import ConfigError
from dfvs_core.geometry.arrays import ImageArray
from dfvs_core.messages.goal import GoalSidecar
from dfvs_core.messages.image import encode_png


def write_goal(image_path: Path, image: ImageArray, sidecar: GoalSidecar) -> None:
    """Write a goal: both files anew, or neither where one cannot be written.

    Raises
    ------
    ConfigError
        If the name does not end in .png, or a file cannot be written.
    """
    if image_path.suffix.lower() != ".png":
        raise ConfigError(
            f"the goal image is to be {str(image_path)!r}", "a name that ends in .png"
        )
    text = sidecar.to_json().encode()
    replace_file(image_path, encode_png(image), (image_path.with_suffix(".json"), text))
