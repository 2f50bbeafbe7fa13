"""Writing a goal's image and sidecar."""

from pathlib import Path

from dfvs_common.atomic_file import replace_file
from dfvs_core.geometry.arrays import ImageArray
from dfvs_core.messages.goal import GoalSidecar
from dfvs_core.messages.image import encode_png


def write_goal(image_path: Path, image: ImageArray, sidecar: GoalSidecar) -> None:
    """Write a goal, whose name ends in .png: both files anew, or neither where one cannot be.

    Raises
    ------
    ConfigError
        If a file cannot be written.
    """
    text = sidecar.to_json().encode()
    replace_file(image_path, encode_png(image), (image_path.with_suffix(".json"), text))
