"""Export of a flight as one ZIP file."""

import contextlib
import os
import zipfile
from pathlib import Path

from dfvs_core.errors import ConfigError
from dfvs_service.flights.store import LOCK


def export_flight(folder: Path, target: Path) -> int:
    """Pack all files of a flight, under its name; returns how many.

    Raises
    ------
    ConfigError
        If the target exists or cannot be written, or a file cannot be read.
    """
    if target.exists():
        raise ConfigError(f"{target} exists", "a name that is free")
    partial = target.with_name(target.name + ".part")
    try:
        count = _pack(folder, partial)
        os.replace(partial, target)
    except OSError as error:
        with contextlib.suppress(OSError):
            partial.unlink(missing_ok=True)
        raise ConfigError(
            f"{folder.name} cannot be exported to {target} ({error.strerror})",
            "a folder that exists and is writable",
        ) from error
    return count


def _pack(folder: Path, partial: Path) -> int:
    count = 0
    with zipfile.ZipFile(partial, "w", zipfile.ZIP_DEFLATED) as archive:
        for path in sorted(p for p in folder.rglob("*") if p.is_file() and p.name != LOCK):
            # The oldest files of a running flight may go meanwhile.
            with contextlib.suppress(FileNotFoundError):
                archive.write(path, folder.name / path.relative_to(folder))
                count += 1
    return count
