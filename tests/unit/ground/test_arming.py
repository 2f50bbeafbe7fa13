"""The pilot arms a vehicle whose checks fail for moments."""

from collections.abc import Callable
from typing import Any

import pytest
from pymavlink.dialects.v20 import development as mavlink

from dfvs_sim.ground.pilot import Pilot, PilotError
from dfvs_sim.vehicle.modes import Mode

ACCEPTED, TEMPORARILY_REJECTED, DENIED = 0, 1, 2


class FlickeringVehicle:
    """A vehicle in Hold that answers commands to arm with these results, the last one for ever."""

    def __init__(self, *results: int) -> None:
        self._results = results
        self.asked = 0
        self._is_armed = False
        self.texts: list[tuple[int, str]] = []

    def command(self, command: int, *params: float) -> int:
        assert (command, params) == (mavlink.MAV_CMD_COMPONENT_ARM_DISARM, (1.0,))
        self.asked += 1
        result = self._results[min(self.asked, len(self._results)) - 1]
        self._is_armed = result == ACCEPTED
        return result

    def latest(self, name: str) -> Any:
        return self.wait_for(name, 0.0)

    def wait_for(
        self,
        name: str,
        _timeout_s: float,
        accept: Callable[[Any], bool] = lambda _: True,
        since_ns: int = 0,
    ) -> Any:
        if name != "HEARTBEAT":
            return None
        base_mode = mavlink.MAV_MODE_FLAG_SAFETY_ARMED if self._is_armed else 0
        message = mavlink.MAVLink_heartbeat_message(2, 12, base_mode, Mode.HOLD.custom_mode, 3, 3)
        return message if accept(message) else None


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
