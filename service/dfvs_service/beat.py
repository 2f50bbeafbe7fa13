"""Heartbeats of the gate to its parent."""

from __future__ import annotations

import json
from dataclasses import dataclass

from dfvs_core.errors import ConfigError, WireError
from dfvs_core.gate.preflight import Check
from dfvs_core.schema import dump, parse


@dataclass(frozen=True, slots=True)
class Beat:
    """Sign of life of the gate's loop, with what the user may want to see of it."""

    t_ns: int
    state: str
    cause: str
    error_m: float | None = None
    error_rad: float | None = None
    reached: bool = False
    warnings: tuple[str, ...] = ()
    checks: tuple[Check, ...] = ()
    """Preflight list, while not engaged."""

    def to_bytes(self) -> bytes:
        """Datagram of this beat."""
        return json.dumps(dump(self), separators=(",", ":")).encode()

    @classmethod
    def from_bytes(cls, data: bytes) -> Beat:
        """Read a datagram.

        Raises
        ------
        WireError
            If it is not a beat.
        """
        try:
            return parse(cls, json.loads(data))
        except (ValueError, ConfigError) as error:
            raise WireError(f"datagram is not a beat: {error}") from error
