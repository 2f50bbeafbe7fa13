"""Folder of what the service keeps between its starts."""

import os
from collections.abc import Mapping
from pathlib import Path


def state_folder(environment: Mapping[str, str]) -> Path:
    """Absolute path of the state folder, which need not be there.

    systemd's ``$STATE_DIRECTORY``, else ``dfvs`` in ``$XDG_STATE_HOME`` or ``~/.local/state``.

    Raises
    ------
    RuntimeError
        If none of them is known: there is no home folder.
    """
    if state := environment.get("STATE_DIRECTORY", "").split(":")[0]:
        return Path(state).absolute()
    # The XDG specification has relative paths ignored.
    if os.path.isabs(state := environment.get("XDG_STATE_HOME", "")):
        return Path(state) / "dfvs"
    return Path.home() / ".local" / "state" / "dfvs"


def engine_cache(environment: Mapping[str, str]) -> str:
    """Folder in which TensorRT's engines are kept, empty where no state folder is known."""
    try:
        return str(state_folder(environment) / "engines")
    except RuntimeError:
        return ""
