"""Requirements of a recording: libraries and a folder."""

import os
from pathlib import Path

from dfvs_common.extras import require_package
from dfvs_core.errors import ConfigError

_MODULES = ("mcap", "mcap_protobuf", "foxglove_schemas_protobuf")


def require_record_extra() -> None:
    """Say what is missing before anything is started.

    Raises
    ------
    ConfigError
        If one of the libraries is not installed.
    """
    for name in _MODULES:
        require_package("recordings need", name, "record")


def prepare_folder(path: Path) -> Path:
    """Make the folder for recordings, and see that it can be written to; ``~`` is a home folder.

    Raises
    ------
    ConfigError
        If it cannot.
    """
    try:
        path = path.expanduser()
        path.mkdir(parents=True, exist_ok=True)
    except (OSError, RuntimeError) as error:  # the latter: there is no such home folder
        reason = error.strerror if isinstance(error, OSError) else error
        raise ConfigError(
            f"the folder for recordings {path} cannot be made ({reason})", "a folder"
        ) from error
    if not os.access(path, os.W_OK | os.X_OK):
        raise ConfigError(f"the folder for recordings {path} cannot be written to")
    return path
