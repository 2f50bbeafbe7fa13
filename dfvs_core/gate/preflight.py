"""Preflight: what must be right before the gate offers to engage."""

from __future__ import annotations

from dataclasses import dataclass

from dfvs_core.gate.config import GateConfig
from dfvs_core.gate.sight import Sight
from dfvs_core.gate.vehicle import (
    NEVER,
    Fault,
    VehiclePicture,
    battery_fault,
    estimate_fault,
    link_fault,
)


@dataclass(frozen=True, slots=True)
class Check:
    """One line of the preflight list; ``detail`` says what is wrong where it is not ok."""

    name: str
    ok: bool
    detail: str = ""


def preflight(
    vehicle: VehiclePicture, sight: Sight, config: GateConfig, now_ns: int
) -> tuple[Check, ...]:
    """Preflight list of this moment."""
    return (
        _from_fault("link", link_fault(vehicle, config, now_ns)),
        _from_fault("estimator", estimate_fault(vehicle, config)),
        _health(vehicle, config, now_ns),
        _from_fault("battery", battery_fault(vehicle, config)),
        _parameters(vehicle),
        _from_fault("frames", sight.stale(now_ns)),
        _overlap(sight, config),
    )


def sole_commander(vehicle: VehiclePicture, now_ns: int, *, may_be_offboard: bool) -> Check:
    """Refuse a vehicle that somebody else commands, or stands by to.

    ``may_be_offboard`` is for the moment in which the pilot's switch to OFFBOARD is awaited.
    """
    if vehicle.is_offboard and vehicle.is_armed and not may_be_offboard:
        detail = "the vehicle is in OFFBOARD, but not by this service"
    else:
        detail = vehicle.rivals.preflight_fault(now_ns)
    return Check("sole commander", not detail, detail)


def failures(checks: tuple[Check, ...]) -> str:
    """One line that names every failed check, empty where there is none."""
    return "; ".join(f"{c.name}: {c.detail}" for c in checks if not c.ok)


def _from_fault(name: str, fault: Fault | None) -> Check:
    if fault is None:
        return Check(name, True)
    cause, detail = fault
    return Check(name, False, f"{cause}, {detail}" if detail else str(cause))


def _health(vehicle: VehiclePicture, config: GateConfig, now_ns: int) -> Check:
    if vehicle.heartbeat.failsafe:
        return Check("health", False, "autopilot in failsafe")
    if now_ns - vehicle.health.t_ns > config.timing.health_age_ns:
        return Check("health", False, "no SYS_STATUS heard")
    if not vehicle.health.ok:
        return Check("health", False, vehicle.health.detail)
    if not vehicle.is_armed and not vehicle.health.can_arm:
        return Check("health", False, "the autopilot's checks before arming fail")
    if vehicle.landed.t_ns == NEVER:
        return Check("health", False, "no EXTENDED_SYS_STATE heard")
    return Check("health", True)


def _parameters(vehicle: VehiclePicture) -> Check:
    read = vehicle.parameters.t_ns != NEVER
    return Check("parameters", read, "" if read else "not read back yet")


def _overlap(sight: Sight, config: GateConfig) -> Check:
    if sight.lost:
        return Check("goal", False, f"goal lost, {sight.reason}")
    if sight.overlap < config.min_overlap:
        detail = f"overlap {sight.overlap:.0%}, {config.min_overlap:.0%} needed"
        return Check("goal", False, detail)
    return Check("goal", True)
