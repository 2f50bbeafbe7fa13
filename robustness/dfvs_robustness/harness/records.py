"""What was recorded, and how it is read."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from dfvs_sim.vehicle.messages.telemetry import Message
from dfvs_sim.vehicle.modes import mode_from_custom

ROGUE_COMPONENT, PILOT_COMPONENT = 196, 190
"""Who else sends to the vehicle."""

MODE_REPORTS = ("heartbeat_sent", "mode_sent")
"""Kinds of events by which the gate can know of a takeover."""

Event = dict[str, Any]
"""One entry of the vehicle's record or of the gate's log: ``t_ns``, ``kind`` and more."""


@dataclass(frozen=True, slots=True)
class Run:
    """Records of one run of the service.

    ``events`` is the vehicle's record in that time, ``transitions`` the gate's log, ``frames``
    the capture times of good frames. ``disturbed_ns`` is when gate or record were broken on
    purpose, after which the stream and the log prove nothing.
    """

    events: Sequence[Event]
    transitions: Sequence[Event]
    frames: Sequence[int]
    journal: Path
    disturbed_ns: int | None = None
    is_reduced: bool = True
    """Every flight begins at reduced speed, with the initial-response check."""


def is_ours(event: Event) -> bool:
    """Whether an event of the vehicle's record is not somebody else's message."""
    return event.get("compid") not in (ROGUE_COMPONENT, PILOT_COMPONENT)


def mode_report(message: Message) -> tuple[str, Event] | None:
    """Kind and fields of a message of the vehicle's that tells of its mode; None of any other."""
    kind = {"HEARTBEAT": "heartbeat_sent", "CURRENT_MODE": "mode_sent"}.get(message.get_type())
    if kind is None:
        return None
    mode = mode_from_custom(message.custom_mode)
    fields: Event = {"mode": mode.name if mode else ""}
    if kind == "heartbeat_sent":
        fields["armed"] = message.base_mode >= 128
    return kind, fields


def moves(setpoint: Event) -> bool:
    """Whether a setpoint is not zero."""
    values = (*setpoint["velocity"], setpoint["yaw_rate_rad_s"])
    return any(isinstance(v, str) or v != 0.0 for v in values)
