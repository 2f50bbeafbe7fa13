"""A vehicle in the air, shared by the tests of a module."""

import math
from collections.abc import Iterator

import pytest
from vehicle_process import Hovering, companion_connected, linked_vehicle

from dfvs_sim.ground.pilot import Pilot
from dfvs_sim.vehicle.modes import Mode


@pytest.fixture(scope="module")
def airborne(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Hovering]:
    folder = tmp_path_factory.mktemp("vehicle")
    with (
        linked_vehicle(folder, "--ready-after", "0.5", "--start", "5,6,-1,30") as (vehicle, link),
        companion_connected(vehicle.companion_port) as system,
    ):
        pilot = Pilot(link)
        pilot.prepare()
        pilot.take_off(1.5)
        yield Hovering(vehicle, link, pilot, system)


@pytest.fixture
def hovering(airborne: Hovering) -> Hovering:
    """The airborne vehicle, at rest in Hold."""
    last = airborne.vehicle.events("pose")[-1]
    if last["mode"] != "HOLD" or math.hypot(*last["velocity"]) > 0.01:
        airborne.pilot.set_mode(Mode.HOLD)
        airborne.pilot.wait_until_hovering()
    return airborne
