"""The vehicle's own record: one JSON object a line, readable even after a kill.

Every line has ``t_ns`` (monotonic) and ``kind``: ``setpoint``, ``mode_command``, ``arm_command``,
``command``, ``parameter``, ``heartbeat`` (from a link), ``state`` (mode, arming, landing) and
``pose`` (the truth, in the scene's world frame).
"""

import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any, TextIO

from dfvs_core.errors import ConfigError


class VehicleRecord:
    """Writes the record; each line reaches the operating system as it is written."""

    def __init__(self, path: Path) -> None:
        try:
            self._file: TextIO = path.open("w", encoding="utf-8", buffering=1)
        except OSError as error:
            raise ConfigError(
                f"cannot write the record {str(path)!r} ({error.strerror})", "a writable file"
            ) from error

    def __call__(self, t_ns: int, kind: str, fields: dict[str, Any]) -> None:
        """Append one event."""
        line = json.dumps({"t_ns": t_ns, "kind": kind, **fields}, allow_nan=False)
        self._file.write(line + "\n")

    def close(self) -> None:
        """Close the file."""
        self._file.close()


def read_record(path: Path) -> Iterator[dict[str, Any]]:
    """Events of a record in the order of writing; a torn last line is left out."""
    with path.open(encoding="utf-8") as file:
        for line in file:
            if line.endswith("\n"):
                yield json.loads(line)
