"""``dfvs-sim vehicle``: the simulated vehicle in real time."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from dfvs_sim.vehicle.messages.streams import COMPANION, GROUND
from dfvs_sim.vehicle.messages.udp_link import UdpLink, UdpPorts, wait_for_data
from dfvs_sim.vehicle.motion.flight import VehicleConfig
from dfvs_sim.vehicle.px4 import STEP_NS, Journal, Px4
from dfvs_sim.vehicle.record import VehicleRecord
from dfvs_sim.vehicle.status import NS_PER_S

COMPANION_PORTS, GROUND_PORTS = UdpPorts(14580, 14540), UdpPorts(18570, 14550)
"""PX4's own: the vehicle's side, and the port on which the peer listens."""

_POSE_NS = NS_PER_S // 30


@dataclass(frozen=True, slots=True)
class ProcessConfig:
    """Ports, record and start of one simulated vehicle.

    ``start_m`` is where the local frame's origin lies in the scene's world frame (NED).
    """

    companion: UdpPorts = COMPANION_PORTS
    ground: UdpPorts = GROUND_PORTS
    record: Path | None = None
    start_m: tuple[float, float, float] = (0.0, 0.0, 0.0)
    seed: int = 0
    vehicle: VehicleConfig = field(default_factory=VehicleConfig)


def run_vehicle(config: ProcessConfig, stop: Callable[[], bool] = lambda: False) -> None:
    """Fly until ``stop`` says so.

    Raises
    ------
    ConfigError
        If a port is taken or the record cannot be written.
    """
    record = VehicleRecord(config.record) if config.record else None
    links: list[UdpLink] = []
    try:
        links.append(UdpLink(COMPANION, config.companion, config.vehicle.system_id))
        links.append(UdpLink(GROUND, config.ground, config.vehicle.system_id))
        _loop(config, record, links, stop)
    finally:
        for link in links:
            link.close()
        if record:
            record.close()


def _loop(
    config: ProcessConfig,
    record: VehicleRecord | None,
    links: list[UdpLink],
    stop: Callable[[], bool],
) -> None:
    rng = np.random.default_rng(config.seed)
    now_ns = time.monotonic_ns()
    journal: Journal = record or (lambda t_ns, kind, fields: None)
    px4 = Px4(config.vehicle, now_ns, rng, journal)
    by_name = {link.name: link for link in links}
    next_step_ns, next_pose_ns = now_ns, now_ns
    while not stop():
        wait_for_data(links, (next_step_ns - time.monotonic_ns()) / NS_PER_S)
        now_ns = time.monotonic_ns()
        for link in links:
            for message in link.receive():
                for answer in px4.handle(message, link.name, now_ns):
                    link.send(answer)
        if now_ns < next_step_ns:
            continue
        for name, message in px4.step(now_ns):
            by_name[name].send(message)
        next_step_ns = max(next_step_ns + STEP_NS, now_ns)
        if now_ns >= next_pose_ns:
            next_pose_ns = max(next_pose_ns + _POSE_NS, now_ns)
            journal(px4.time_ns, "pose", true_pose(px4, config.start_m))


def true_pose(px4: Px4, start_m: tuple[float, float, float]) -> dict[str, object]:
    """True pose and velocity: position in the scene's world frame (NED, m), angles in rad."""
    v = px4.flight.vehicle
    return {
        "position": [round(a + b, 6) for a, b in zip(start_m, v.position_m, strict=True)],
        "attitude": [round(a, 7) for a in v.attitude_rad],
        "velocity": [round(a, 6) for a in v.velocity_m_s],
        "mode": px4.status.mode.name,
        "armed": px4.status.armed,
    }
