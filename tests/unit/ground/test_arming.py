"""The pilot arms a vehicle whose checks fail for moments."""

from typing import Any

import pytest
from fake_ground_link import FakeGroundLink
from pymavlink.dialects.v20 import development as mavlink

from dfvs_sim.ground.pilot import Pilot, PilotError
from dfvs_sim.vehicle.modes import Mode

ACCEPTED, TEMPORARILY_REJECTED, DENIED = 0, 1, 2


class FlickeringVehicle(FakeGroundLink):
    """A vehicle in Hold that answers commands to arm with these results, the last one for ever."""

    def __init__(self, *results: int) -> None:
        super().__init__()
        self._results = results
        self.asked = 0
        self._is_armed = False

    def command(self, command: int, *params: float) -> int:
        assert (command, params) == (mavlink.MAV_CMD_COMPONENT_ARM_DISARM, (1.0,))
        self.asked += 1
        result = self._results[min(self.asked, len(self._results)) - 1]
        self._is_armed = result == ACCEPTED
        return result

    def message(self, name: str) -> Any:
        if name != "HEARTBEAT":
            return None
        base_mode = mavlink.MAV_MODE_FLAG_SAFETY_ARMED if self._is_armed else 0
        return mavlink.MAVLink_heartbeat_message(2, 12, base_mode, Mode.HOLD.custom_mode, 3, 3)


def arm(vehicle: FlickeringVehicle, arming_s: float = 60.0) -> None:
    Pilot(vehicle, arming_s=arming_s).arm()  # type: ignore[arg-type]


def test_a_temporary_rejection_is_asked_again() -> None:
    vehicle = FlickeringVehicle(TEMPORARILY_REJECTED, TEMPORARILY_REJECTED, ACCEPTED)
    arm(vehicle)
    assert vehicle.asked == 3


def test_a_rejection_that_lasts_is_an_error() -> None:
    with pytest.raises(PilotError, match="arming was temporarily rejected"):
        arm(FlickeringVehicle(TEMPORARILY_REJECTED), arming_s=0.01)


def test_another_refusal_is_an_error_at_once() -> None:
    vehicle = FlickeringVehicle(DENIED)
    with pytest.raises(PilotError, match="arming was denied"):
        arm(vehicle)
    assert vehicle.asked == 1
