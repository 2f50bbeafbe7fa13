"""Atomic replacement of small files."""

import contextlib
import json
import os
from pathlib import Path
from typing import Any

from dfvs_core.errors import ConfigError


def write_atomic(path: Path, data: bytes) -> None:
    """Write a file so that it is whole or not there at all, also after a power loss.

    Raises
    ------
    OSError
        If it cannot be written; what was there before stays.
    """
    partial = path.with_name(path.name + ".part")
    try:
        with partial.open("wb") as file:
            file.write(data)
            file.flush()
            os.fsync(file.fileno())
        os.replace(partial, path)
    except OSError:
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


def replace_file(path: Path, data: bytes) -> None:
    """Write a file that a user named, whole or not at all.

    Raises
    ------
    ConfigError
        If it cannot be written.
    """
    try:
        write_atomic(path, data)
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
