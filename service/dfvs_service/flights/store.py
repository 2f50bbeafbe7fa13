"""Folder of all flights: location, names, and removal of the oldest."""

import contextlib
import fcntl
import itertools
import os
import re
import shutil
import time
from collections.abc import Mapping
from pathlib import Path
from typing import IO

from dfvs_common.file_size import file_bytes
from dfvs_core.errors import ConfigError
from dfvs_service.settings.record_sections import BlackBoxSection
from dfvs_service.settings.state_folder import state_folder

_NAME = re.compile(r"(?P<date>\d{8}T\d{6}Z)-(?P<vehicle>[a-z0-9][a-z0-9_-]*)(\.(?P<number>\d+))?")
LOCK = "lock"
"""File whose lock a running flight holds."""


def flights_folder(section: BlackBoxSection, environment: Mapping[str, str]) -> Path:
    """Absolute path of the folder of all flights.

    ``black_box.folder``, else ``flights`` in systemd's ``$STATE_DIRECTORY``, else
    ``dfvs/flights`` in ``$XDG_STATE_HOME`` or ``~/.local/state``.

    Raises
    ------
    ConfigError
        If none of them is known.
    """
    try:
        if section.folder:
            return Path(section.folder).expanduser().absolute()
        return state_folder(environment) / "flights"
    except RuntimeError as error:
        raise ConfigError(
            "no folder for flights is known: there is no home folder",
            "black_box.folder, $STATE_DIRECTORY, $XDG_STATE_HOME or $HOME",
        ) from error


class FlightStore:
    """Flights of a folder, one folder each.

    ``path`` need not exist.
    """

    def __init__(self, path: Path) -> None:
        self.path = path

    def names(self) -> list[str]:
        """Names of all flights, oldest first; what is no flight is left out.

        Raises
        ------
        ConfigError
            If the folder cannot be read.
        """
        try:
            return self._found()
        except OSError as error:
            raise ConfigError(
                f"the folder of flights {self.path} cannot be read ({error.strerror})",
                "a folder that this user may read",
                "see black_box.folder",
            ) from error

    def _found(self) -> list[str]:
        try:
            found = [entry.name for entry in os.scandir(self.path) if entry.is_dir()]
        except FileNotFoundError:
            return []
        return sorted((name for name in found if _NAME.fullmatch(name)), key=_order)

    def folder(self, name: str) -> Path:
        """Folder of a flight; ``latest`` is the newest one.

        Raises
        ------
        ConfigError
            If there is no such flight.
        """
        names = self.names()
        chosen = names[-1] if name == "latest" and names else name
        if chosen not in names:
            raise ConfigError(
                f"there is no flight {name!r} in {self.path}",
                f"one of the {len(names)} flights there" if names else "a folder with flights",
                "list them with: dfvs-service flights",
            )
        return self.path / chosen

    def create(self, vehicle: str, t_unix_s: float) -> tuple[Path, IO[str]]:
        """Make the folder of a new flight, readable by its owner alone, and mark it as running.

        It is the newest, whatever the clock says: where that stepped back, the name's number grows.
        The mark is the file's lock, which goes when the file is closed, or with the process.

        Raises
        ------
        OSError
            If it cannot be made.
        """
        self.path.mkdir(mode=0o700, parents=True, exist_ok=True)
        newest = max(map(_order, self._found()), default=(1, "", ""))
        date_name = time.strftime("%Y%m%dT%H%M%SZ", time.gmtime(t_unix_s)) + f"-{vehicle}"
        for number in itertools.count(newest[0]):
            name = date_name if number == 1 else f"{date_name}.{number}"
            if _order(name) <= newest:
                continue
            with contextlib.suppress(FileExistsError):
                (self.path / name).mkdir(mode=0o700)
                return self.path / name, _lock(self.path / name)
        raise RuntimeError("the endless row of names has ended")

    def make_room(self, max_bytes: int) -> None:
        """Remove the oldest flights until the rest is no larger; running ones are kept.

        Raises
        ------
        OSError
            If the folder cannot be read.
        """
        sizes = {name: folder_bytes(self.path / name) for name in self._found()}
        total = sum(sizes.values())
        for name, size in sizes.items():
            if total <= max_bytes:
                break
            if is_running(self.path / name):
                continue
            shutil.rmtree(self.path / name, ignore_errors=True)
            total -= size


def _lock(folder: Path) -> IO[str]:
    """Lock a new folder; remove it where that fails."""
    try:
        lock = (folder / LOCK).open("w")
        fcntl.flock(lock, fcntl.LOCK_EX)
    except OSError:
        shutil.rmtree(folder, ignore_errors=True)
        raise
    return lock


def parts_of(name: str) -> tuple[str, str]:
    """Date and vehicle in the name of a flight, empty where it is none."""
    match = _NAME.fullmatch(name)
    return ("", "") if match is None else (match["date"], match["vehicle"])


def is_running(folder: Path) -> bool:
    """Whether a process still writes this flight."""
    try:
        with (folder / LOCK).open("r") as lock:
            fcntl.flock(lock, fcntl.LOCK_SH | fcntl.LOCK_NB)
    except BlockingIOError:
        return True
    except OSError:
        return False
    return False


def folder_bytes(folder: Path) -> int:
    """Size of all files in a folder and below; those that vanish meanwhile do not count."""
    walk = os.walk(folder)
    return sum(file_bytes(Path(where) / name) for where, _, names in walk for name in names)


def _order(name: str) -> tuple[int, str, str]:
    """Key of the order in which flights were made: the number first, since clocks step back."""
    match = _NAME.fullmatch(name)
    if match is None:
        return 0, "", name
    return int(match["number"] or 1), match["date"], match["vehicle"]
