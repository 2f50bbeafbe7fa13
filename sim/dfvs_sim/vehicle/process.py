"""``dfvs-sim vehicle``: the simulated vehicle in real time."""

import contextlib
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from dfvs_sim.vehicle.messages.streams import COMPANION, GROUND
from dfvs_sim.vehicle.messages.udp_link import UdpLink, UdpPorts, wait_for_data
from dfvs_sim.vehicle.motion.flight import VehicleConfig
from dfvs_sim.vehicle.px4 import STEP_NS, Journal, Px4, no_journal
from dfvs_sim.vehicle.record import VehicleRecord
from dfvs_sim.vehicle.status import NS_PER_S

_POSE_NS = NS_PER_S // 30


@dataclass(frozen=True, slots=True)
class ProcessConfig:
    """Ports, record and start of one simulated vehicle.

    ``start_m`` is where the local frame's origin lies in the scene's world frame (NED).
    """

    companion: UdpPorts
    ground: UdpPorts
    record: Path | None
    start_m: tuple[float, float, float]
    seed: int
    vehicle: VehicleConfig


def run_vehicle(config: ProcessConfig, stop: Callable[[], bool]) -> None:
    """Fly until ``stop`` says so.

    Raises
    ------
    ConfigError
        If a port is taken or the record cannot be written.
    """
    system_id = config.vehicle.system_id
    with contextlib.ExitStack() as stack:
        journal: Journal = no_journal
        if config.record:
            journal = stack.enter_context(contextlib.closing(VehicleRecord(config.record)))
        links = {
            name: stack.enter_context(contextlib.closing(UdpLink(name, ports, system_id)))
            for name, ports in ((COMPANION, config.companion), (GROUND, config.ground))
        }
        _loop(config, journal, links, stop)


def _loop(
    config: ProcessConfig, journal: Journal, links: dict[str, UdpLink], stop: Callable[[], bool]
) -> None:
    now_ns = time.monotonic_ns()
    px4 = Px4(config.vehicle, now_ns, np.random.default_rng(config.seed), journal)
    next_step_ns, next_pose_ns = now_ns, now_ns
    while not stop():
        wait_for_data(links.values(), (next_step_ns - time.monotonic_ns()) / NS_PER_S)
        now_ns = time.monotonic_ns()
        for name, link in links.items():
            for message in link.receive():
                for answer in px4.handle(message, name, now_ns):
                    link.send(answer)
        if now_ns < next_step_ns:
            continue
        for name, message in px4.step(now_ns):
            links[name].send(message)
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
