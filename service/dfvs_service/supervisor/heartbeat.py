"""Heartbeats of the gate to its parent."""

from __future__ import annotations

from dataclasses import dataclass

from dfvs_core.gate.checks.preflight import Check
from dfvs_core.messages.schema import from_json, to_json


@dataclass(frozen=True, slots=True)
class Heartbeat:
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
        """Datagram of this heartbeat."""
        return to_json(self)

    @classmethod
    def from_bytes(cls, data: bytes) -> Heartbeat:
        """Read a datagram.

        Raises
        ------
        WireError
            If it is not a heartbeat.
        """
        return from_json(cls, data)
