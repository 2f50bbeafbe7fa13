"""Session header of a recording, from which a flight can be rerun."""

import time
from typing import Any

from dfvs_core.messages.frame_record import SessionHeader
from dfvs_core.messages.goal import Goal
from dfvs_core.messages.schema import dump
from dfvs_service.perception.assembly import perception_files
from dfvs_service.perception.build import build_versions
from dfvs_service.settings.config import ServiceConfig


class SessionHeaders:
    """Session headers of one process: code and models are hashed once, none of it in flight.

    Parameters
    ----------
    config : ServiceConfig
        Resolved settings.
    clock : bytes
        Which monotonic clock the process has.

    Raises
    ------
    ModelError
        If the model's files cannot be read.
    """

    def __init__(self, config: ServiceConfig, clock: bytes) -> None:
        self._vehicle, self._clock = config.vehicle.name, clock.hex()
        self._settings: dict[str, Any] = dump(config)
        self._build, self._model = build_versions(), perception_files(config)

    def make(
        self, goal: Goal, first_turn: int = 0, observed_ns: int | None = None
    ) -> SessionHeader:
        """Header, as of now, of the work on a goal; ``observed_ns`` is the pipeline's."""
        sidecar: dict[str, Any] = dump(goal.sidecar)
        now_ns = time.monotonic_ns()
        return SessionHeader(
            vehicle=self._vehicle,
            first_turn=first_turn,
            opened_ns=now_ns,
            clock=self._clock,
            unix_offset_ns=time.time_ns() - now_ns,
            build=self._build,
            model=self._model,
            settings=self._settings,
            sidecar=sidecar,
            observed_ns=observed_ns,
        )
