"""Size of files that others may remove meanwhile."""

from pathlib import Path


def file_bytes(path: Path) -> int:
    """Size of a file; 0 where it is gone or cannot be read."""
    try:
        return path.stat().st_size
    except OSError:
        return 0
