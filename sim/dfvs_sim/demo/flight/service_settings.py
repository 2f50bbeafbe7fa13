"""The settings that a service flies by, asked of the service itself."""

import subprocess
import sys
import tomllib
from collections.abc import Sequence
from typing import Any

from dfvs_core.errors import ConfigError

_TIMEOUT_S = 60.0


def settings_in_force(words: Sequence[str]) -> dict[str, Any]:
    """All settings of a service with these words, by section and key.

    Parameters
    ----------
    words : sequence of str
        Options of a flight, as ``dfvs-service`` takes them.

    Raises
    ------
    ConfigError
        If the service refuses them, or does not answer.
    """
    command = [sys.executable, "-m", "dfvs_service.cli", "config", *words]
    try:
        done = subprocess.run(
            command, capture_output=True, text=True, check=False, timeout=_TIMEOUT_S
        )
    except subprocess.TimeoutExpired as error:
        raise ConfigError(
            f"dfvs-service config gave no answer in {_TIMEOUT_S:g} s", "an idle machine"
        ) from error
    if done.returncode != 0:
        said = (done.stderr.strip().splitlines() or ["nothing said"])[-1]
        raise ConfigError(f"dfvs-service refuses its words: {said.partition('error: ')[2] or said}")
    try:
        return tomllib.loads(done.stdout)
    except tomllib.TOMLDecodeError as error:
        raise ConfigError(f"{' '.join(words)!r} are no words of a flight") from error
