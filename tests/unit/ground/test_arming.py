"""The pilot arms in Hold, also a vehicle whose checks fail for moments."""

from typing import Any

import pytest
from fake_ground_link import FakeGroundLink
from pymavlink.dialects.v20 import development as mavlink

from dfvs_sim.ground.pilot import Pilot, PilotError
from dfvs_sim.vehicle.modes import Mode, mode_from_numbers

ACCEPTED, TEMPORARILY_REJECTED, DENIED = 0, 1, 2


class FlickeringVehicle(FakeGroundLink):
    """A vehicle that answers commands to arm with these results, the last one for ever."""

    def __init__(self, *results: int, mode: Mode | None = Mode.HOLD) -> None:
        super().__init__()
        self._results = results
        self.mode = mode
        self.asked = 0
        self.is_armed = False

    def wait_for_vehicle(self, _timeout_s: float) -> None:
        """It is there."""

    def command(self, command: int, *params: float) -> int:
        if command == mavlink.MAV_CMD_DO_SET_MODE:
            self.mode = mode_from_numbers(*map(int, params[1:]))
            return ACCEPTED
        assert (command, params) == (mavlink.MAV_CMD_COMPONENT_ARM_DISARM, (1.0,))
        assert self.mode is Mode.HOLD
        self.asked += 1
        result = self._results[min(self.asked, len(self._results)) - 1]
        self.is_armed = result == ACCEPTED
        return result

    def message(self, name: str) -> Any:
        if name == "HOME_POSITION":
            return "known"
        if name != "HEARTBEAT" or self.mode is None:
            return None
        base_mode = mavlink.MAV_MODE_FLAG_SAFETY_ARMED if self.is_armed else 0
        return mavlink.MAVLink_heartbeat_message(2, 12, base_mode, self.mode.custom_mode, 3, 3)


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


@pytest.mark.parametrize("mode", [Mode.TAKEOFF, Mode.POSITION, Mode.LAND, Mode.OFFBOARD])
def test_another_mode_than_hold_is_left_before_arming(mode: Mode) -> None:
    """PX4 shows Take-off after one that ended in Land: armed in it, it takes off at once."""
    vehicle = FlickeringVehicle(ACCEPTED, mode=mode)
    arm(vehicle)
    assert vehicle.asked == 1


def test_a_vehicle_that_is_armed_need_not_be_ready_to_arm() -> None:
    """PX4 reports that by its mode: one that lands could not be armed, and may climb again."""
    vehicle = FlickeringVehicle(DENIED, mode=Mode.LAND)
    vehicle.is_armed = True
    Pilot(vehicle).wait_until_armable()  # type: ignore[arg-type]
    assert vehicle.mode is Mode.LAND
