"""Gate status for perception and telemetry."""

import json
import math

from dfvs_core.gate.config import NEVER, S
from dfvs_core.gate.machine import GateMachine
from dfvs_core.gate.vehicle import VehicleMonitor
from dfvs_core.messages.link import GateStatus, VehicleState

_MOST_TEXT_BYTES = 300
"""Of a text in JSON, which takes six bytes for a character outside of ASCII."""
_MAX_WARNINGS = 4


def vehicle_state(vehicle: VehicleMonitor) -> VehicleState | None:
    """Attitude with the newest velocity, and the position extrapolated to its time.

    It is extrapolated by no more than the age up to which it may be flown by. None until both were
    received, and where a number is not finite: the wire carries none of those.
    """
    attitude, position = vehicle.attitude, vehicle.position
    angles = (attitude.roll_rad, attitude.pitch_rad, attitude.yaw_rad)
    numbers = (*angles, *position.velocity_m_s, *position.position_m)
    if NEVER in (attitude.t_ns, position.t_ns) or not all(map(math.isfinite, numbers)):
        return None
    since_s = min(max(attitude.t_ns - position.t_ns, 0), vehicle.timing.telemetry_age_ns) / S
    x, y, z = (
        p + v * since_s for p, v in zip(position.position_m, position.velocity_m_s, strict=True)
    )
    return VehicleState(attitude.t_ns, *angles, position.velocity_m_s, (x, y, z))


def gate_status(
    machine: GateMachine,
    now_ns: int,
    *,
    challenge: str,
    command: tuple[str, int],
    warnings: tuple[str, ...],
) -> GateStatus:
    """Status of this moment; ``command`` is the last command's result and how many came."""
    vehicle, setpoint = machine.vehicle, machine.stream.last
    heartbeat = vehicle.heartbeat
    return GateStatus(
        state=str(machine.state),
        cause=_cut(machine.reason),
        vehicle=vehicle_state(vehicle),
        t_ns=now_ns,
        reached=machine.has_reached,
        mode=str(heartbeat.mode) if heartbeat.t_ns != NEVER else "",
        armed=heartbeat.armed,
        in_air=vehicle.landed.in_air,
        battery=vehicle.battery.remaining,
        heartbeat_age_s=_age_s(heartbeat.t_ns, now_ns),
        setpoint=(setpoint.forward_m_s, setpoint.right_m_s, setpoint.down_m_s, setpoint.yaw_rad_s),
        distance_m=machine.distance_m if math.isfinite(machine.distance_m) else None,
        challenge=challenge,
        command_result=_cut(command[0]),
        command_count=command[1],
        warnings=tuple(map(_cut, warnings[:_MAX_WARNINGS])),
        goal=machine.perception.goal,
        since_ns=machine.since_ns,
        battery_age_s=_age_s(vehicle.battery.t_ns, now_ns),
    )


def _cut(text: str) -> str:
    """Beginning of a text that takes no more than its share of a datagram."""
    text = text[:_MOST_TEXT_BYTES]
    while len(json.dumps(text)) - 2 > _MOST_TEXT_BYTES:
        text = text[:-1]
    return text


def _age_s(t_ns: int, now_ns: int) -> float | None:
    return None if t_ns == NEVER else (now_ns - t_ns) / S
