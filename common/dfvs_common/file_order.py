"""Order of numbered files."""

import re
from pathlib import Path


def numbered(path: Path) -> list[str | int]:
    """Sorting key: the name without its suffix, digits in it as numbers, so that 1000 is last."""
    parts = re.split(r"(\d+)", path.stem)
    return [int(part) if part.isdecimal() else part for part in parts]
