"""The pilot and the process around the vehicle."""

from pathlib import Path

import pytest
from vehicle_process import free_port, linked_vehicle

from dfvs_sim.ground.link import GroundLink
from dfvs_sim.ground.parameters import get_parameter
from dfvs_sim.ground.pilot import Pilot
from dfvs_sim.ground.systems import LinkError
from dfvs_sim.vehicle.modes import Mode

pytestmark = pytest.mark.real_time


def test_a_whole_flight_from_ready_to_landed(tmp_path: Path) -> None:
    options = ("--ready-after", "0.5", "--estimate", "medium")
    with linked_vehicle(tmp_path, *options) as (vehicle, link):
        pilot = Pilot(link)
        pilot.prepare()
        assert get_parameter(link, "COM_OBL_RC_ACT") == 5
        pilot.take_off(0.5)
        assert pilot.mode() is Mode.HOLD
        height_m = -vehicle.events("pose")[-1]["position"][2]
        assert height_m + 0.08 == pytest.approx(0.5, abs=0.1)
        pilot.land()
        assert not pilot.armed()
        pilot.set_mode(Mode.LAND)
        pilot.prepare()  # Land cannot be armed
        assert pilot.mode() is Mode.HOLD
    assert vehicle.process.returncode == 0


def test_without_a_vehicle_the_pilot_says_so() -> None:
    with (
        GroundLink(f"udpin://127.0.0.1:{free_port()}") as link,
        pytest.raises(LinkError, match="no heartbeat from a vehicle"),
    ):
        link.wait_for_vehicle(0.2)


def test_an_unknown_parameter_is_an_error(tmp_path: Path) -> None:
    with linked_vehicle(tmp_path) as (_, link):
        link.wait_for_vehicle(30.0)
        with pytest.raises(LinkError, match="NO_SUCH_THING"):
            get_parameter(link, "NO_SUCH_THING")
