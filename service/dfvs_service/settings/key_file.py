"""Secret key of signed commands, in a file private to its owner."""

import os
import secrets
import stat
from pathlib import Path

from dfvs_core.errors import ConfigError
from dfvs_core.gate.commands.command import MIN_KEY_BYTES

_NEW_KEY_BYTES = 32
_MAX_KEY_BYTES = 4096
_MAKE_KEY = "dfvs-service command new-key --key-file"


def load_key(path: Path, make: str = _MAKE_KEY) -> bytes:
    """Secret key: the file's bytes without surrounding white space.

    ``make`` is the command that makes such a file.

    Raises
    ------
    ConfigError
        If the file cannot be read, is open to others, or holds too little.
    """
    try:
        with path.open("rb") as file:
            _check_mode(path, os.fstat(file.fileno()).st_mode)
            key = file.read(_MAX_KEY_BYTES).strip()
    except OSError as error:
        raise ConfigError(
            f"cannot read the key file {path} ({error.strerror})",
            "a file with the secret key",
            f"make one with: {make} {path}",
        ) from error
    if len(key) < MIN_KEY_BYTES:
        raise ConfigError(
            f"the key in {path} has {len(key)} bytes", f"at least {MIN_KEY_BYTES} bytes"
        )
    return key


def check_private(path: Path) -> None:
    """Check that nobody but its owner may read a file.

    Raises
    ------
    ConfigError
        If others may, or it is not there.
    """
    try:
        mode = path.stat().st_mode
    except OSError as error:
        raise ConfigError(f"cannot look at {path} ({error.strerror})", "a file") from error
    _check_mode(path, mode)


def _check_mode(path: Path, mode: int) -> None:
    if stat.S_IMODE(mode) & 0o077:
        raise ConfigError(
            f"the key file {path} has mode {stat.S_IMODE(mode):04o}",
            "0600, so that nobody else can read it",
            f"chmod 600 {path}",
        )


def create_key(path: Path) -> None:
    """Write a fresh random key to a new file of mode 0600.

    Raises
    ------
    ConfigError
        If the file exists already or cannot be written.
    """
    try:
        descriptor = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o600)
        try:
            with os.fdopen(descriptor, "w", encoding="ascii") as file:
                file.write(secrets.token_hex(_NEW_KEY_BYTES) + "\n")
        except OSError:
            path.unlink()
            raise
    except OSError as error:
        raise ConfigError(f"cannot create {path} ({error.strerror})", "a new file") from error
