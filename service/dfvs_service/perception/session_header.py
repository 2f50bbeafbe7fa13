"""Session header of a recording, from which a flight can be rerun."""

from __future__ import annotations

import time
from typing import Any

from dfvs_core.messages.frame_record import SessionHeader
from dfvs_core.messages.goal import Goal
from dfvs_core.messages.schema import dump
from dfvs_service.perception.assembly import perception_files
from dfvs_service.perception.build import build_versions
from dfvs_service.settings.config import ServiceConfig


def make_session_header(
    config: ServiceConfig,
    goal: Goal,
    clock: bytes,
    first_turn: int = 0,
    observed_ns: int | None = None,
) -> SessionHeader:
    """Opening, as of now, of perception's work on a goal.

    ``observed_ns`` is :attr:`Pipeline.observed_ns`.

    Raises
    ------
    ModelError
        If the model's files cannot be read.
    """
    sidecar: dict[str, Any] = dump(goal.sidecar)
    settings: dict[str, Any] = dump(config)
    now_ns = time.monotonic_ns()
    return SessionHeader(
        vehicle=config.vehicle.name,
        first_turn=first_turn,
        opened_ns=now_ns,
        clock=clock.hex(),
        unix_offset_ns=time.time_ns() - now_ns,
        build=build_versions(),
        model=perception_files(config),
        settings=settings,
        sidecar=sidecar,
        observed_ns=observed_ns,
    )
