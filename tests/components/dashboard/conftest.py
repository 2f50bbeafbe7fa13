"""Vehicles on a real Zenoh, and a dashboard that watches them."""

import dataclasses
from pathlib import Path

import pytest
from dashboard_server import Server
from loopback import free_endpoint
from telemetry_vehicle import TelemetryVehicle

from dfvs_service.settings.key_file import create_key, load_key


@dataclasses.dataclass
class Field:
    """Two vehicles, each with a Zenoh endpoint of its own, and the keys to order the first."""

    swift: TelemetryVehicle
    heron: TelemetryVehicle
    endpoints: list
    token_file: Path
    key_file: Path

    @property
    def token(self):
        return self.token_file.read_text().strip()


@pytest.fixture(scope="session")
def vehicles(tmp_path_factory):
    folder = tmp_path_factory.mktemp("keys")
    for name in ("operator.token", "command.key"):
        create_key(folder / name)
    key = load_key(folder / "command.key")
    endpoints = [free_endpoint() for _ in range(2)]
    with (
        TelemetryVehicle(endpoints[0], "swift", key) as swift,
        TelemetryVehicle(endpoints[1], "heron") as heron,
    ):
        yield Field(swift, heron, endpoints, folder / "operator.token", folder / "command.key")


@pytest.fixture
def field(vehicles):
    """The vehicles; after a test the first one approaches its goal again."""
    yield vehicles
    vehicles.swift.is_paused, vehicles.swift.mounting_score = False, 12.3
    vehicles.swift.enter("SERVO", "good data")


@pytest.fixture(scope="session")
def server(vehicles):
    words = ("--operator-token", vehicles.token_file, "--command-key", vehicles.key_file)
    with Server(vehicles.endpoints, tuple(map(str, words))) as server:
        yield server
