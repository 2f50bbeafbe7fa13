"""A vehicle process on ports of its own, and what to connect to it."""

import contextlib
import signal
import socket
import subprocess
import sys
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from mavsdk.component_type import ComponentType
from mavsdk.mavsdk import Configuration, Mavsdk
from mavsdk.system import System

from dfvs_sim.demo.flight.ports import any_port
from dfvs_sim.ground.link import GroundLink
from dfvs_sim.ground.pilot import Pilot
from dfvs_sim.vehicle.record import read_record

RUNNER = Path(__file__).parent / "components" / "vehicle" / "run_vehicle.py"


def free_port() -> int:
    return any_port(socket.SOCK_DGRAM)


@dataclass
class RunningVehicle:
    process: subprocess.Popen[bytes]
    companion_port: int
    ground_port: int
    record_path: Path

    def events(self, kind: str) -> list[dict[str, Any]]:
        return [e for e in read_record(self.record_path) if e["kind"] == kind]


@contextlib.contextmanager
def vehicle_running(folder: Path, *options: str) -> Iterator[RunningVehicle]:
    companion, ground = free_port(), free_port()
    record = folder / "vehicle.jsonl"
    ports = ["--companion-port", str(companion), "--gcs-port", str(ground)]
    ports += ["--companion-local-port", "0", "--gcs-local-port", "0"]
    command = [sys.executable, str(RUNNER), "vehicle", *ports, "--record", str(record), *options]
    process = subprocess.Popen(command)
    try:
        yield RunningVehicle(process, companion, ground, record)
    finally:
        process.send_signal(signal.SIGTERM)
        process.wait(20.0)


@contextlib.contextmanager
def linked_vehicle(folder: Path, *options: str) -> Iterator[tuple[RunningVehicle, GroundLink]]:
    """A running vehicle and a ground station's link to it."""
    with (
        vehicle_running(folder, *options) as vehicle,
        GroundLink(f"udpin://127.0.0.1:{vehicle.ground_port}") as link,
    ):
        yield vehicle, link


@contextlib.contextmanager
def companion_connected(port: int) -> Iterator[System]:
    configuration = Configuration.create_with_component_type(ComponentType.COMPANION_COMPUTER)
    mavsdk = Mavsdk(configuration)
    try:
        mavsdk.add_any_connection(f"udpin://127.0.0.1:{port}")
        system = mavsdk.first_autopilot(30.0)
        assert system is not None
        yield system
    finally:
        mavsdk.destroy()


@dataclass
class Hovering:
    """A vehicle in the air with its pilot and MAVSDK on the companion's side."""

    vehicle: RunningVehicle
    link: GroundLink
    pilot: Pilot
    system: System
