"""Atomic replacement of small files."""

import contextlib
import json
import os
from pathlib import Path
from typing import Any

from dfvs_core.errors import ConfigError


def write_atomic(path: Path, data: bytes, *before: tuple[Path, bytes]) -> None:
    """Write a file so that it is whole or not there at all, also after a power loss.

    ``before`` are files of its folder that belong to it. They appear right before it, once all of
    them are on the disk.

    Raises
    ------
    OSError
        If one cannot be written; what was there before stays.
    """
    files = [
        (place, place.with_name(place.name + ".part"), content)
        for place, content in (*before, (path, data))
    ]
    try:
        for _, partial, content in files:
            with partial.open("wb") as file:
                file.write(content)
                file.flush()
                os.fsync(file.fileno())
        for place, partial, _ in files:
            os.replace(partial, place)
    except OSError:
        for _, partial, _ in files:
            partial.unlink(missing_ok=True)
        raise
    sync_folder(path.parent)


def replace_json(path: Path, document: Any) -> None:
    """Write a JSON document whole or not at all.

    Raises
    ------
    OSError
        If it cannot be written; what was there before stays.
    ValueError
        If it holds NaN or infinity.
    """
    write_atomic(path, (json.dumps(document, indent=2, allow_nan=False) + "\n").encode())


def replace_file(path: Path, data: bytes, *before: tuple[Path, bytes]) -> None:
    """Write a file that a user named, as `write_atomic` does.

    Raises
    ------
    ConfigError
        If it cannot be written.
    """
    try:
        write_atomic(path, data, *before)
    except OSError as error:
        raise ConfigError(
            f"{path} cannot be written ({error.strerror})", "a folder that exists and is writable"
        ) from error


def sync_folder(folder: Path) -> None:
    """Have the disk keep the names in a folder, where its file system can do that."""
    with contextlib.suppress(OSError):
        descriptor = os.open(folder, os.O_RDONLY | os.O_DIRECTORY)
        try:
            os.fsync(descriptor)
        finally:
            os.close(descriptor)
