"""How high the pilot has the vehicle climb, where PX4's home is that of an earlier flight."""

from types import SimpleNamespace as Message
from typing import Any

import pytest
from fake_ground_link import FakeGroundLink
from pymavlink.dialects.v20 import development as mavlink

from dfvs_sim.ground.pilot import Pilot, PilotError
from dfvs_sim.vehicle.modes import Mode

GROUND_M = 0.3
"""Local z of the vehicle that stands on the ground; home is 100 m above the sea at local z 0.1."""


class ClimbingVehicle(FakeGroundLink):
    """An armed vehicle in Hold that is where it was sent at once."""

    def __init__(self) -> None:
        super().__init__()
        self.down_m, self.altitude_m = GROUND_M, 0.0

    def command(self, command: int, *params: float) -> int:
        assert command == mavlink.MAV_CMD_NAV_TAKEOFF
        self.altitude_m = params[6]
        self.down_m = 0.1 - (self.altitude_m - 100.0)
        return 0

    def message(self, name: str) -> Any:
        return {
            "HEARTBEAT": Message(base_mode=128, custom_mode=Mode.HOLD.custom_mode),
            "HOME_POSITION": Message(altitude=100_000, z=0.1),
            "LOCAL_POSITION_NED": Message(z=self.down_m, vx=0.0, vy=0.0, vz=0.0),
        }.get(name)


class HoveringVehicle:
    """A vehicle at rest at a local z, which tells its position 50 times a second of its clock."""

    def __init__(self, down_m: float) -> None:
        self.down_m = down_m
        self.now_ns = 0
        self.texts: list[tuple[int, str]] = []

    def monotonic_ns(self) -> int:
        return self.now_ns

    def monotonic(self) -> float:
        return self.now_ns * 1e-9

    def wait_for(self, *_: object, **__: int) -> Any:
        self.now_ns += 20_000_000
        return Message(z=self.down_m, vx=0.0, vy=0.0, vz=0.0)


@pytest.mark.parametrize(
    ("down_m", "words"),
    [(-1.8, "is 0.30 m above the wanted"), (-1.1, "is 0.40 m below the wanted")],
)
def test_a_vehicle_at_rest_at_another_height_is_told_as_such(
    down_m: float, words: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    vehicle = HoveringVehicle(down_m)
    monkeypatch.setattr("dfvs_sim.ground.pilot.time", vehicle)
    with pytest.raises(PilotError, match=words):
        Pilot(vehicle, hover_s=5.0).wait_until_hovering(-1.5)  # type: ignore[arg-type]


def test_it_is_that_above_where_the_vehicle_stands() -> None:
    vehicle = ClimbingVehicle()
    with pytest.raises(PilotError, match="come to rest"):  # a window of rest takes longer
        Pilot(vehicle, hover_s=0.01).take_off(1.5)  # type: ignore[arg-type]
    assert vehicle.altitude_m == pytest.approx(100.0 + 0.1 - GROUND_M + 1.5)
    assert vehicle.down_m == pytest.approx(GROUND_M - 1.5)
