"""The pilot and the process around the vehicle."""

from pathlib import Path

import pytest
from vehicle_process import free_port, linked_vehicle

from dfvs_sim.ground.link import GroundLink
from dfvs_sim.ground.parameters import get_parameter
from dfvs_sim.ground.pilot import Pilot, PilotError
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


@pytest.mark.slow
def test_a_vehicle_whose_estimate_never_rests_takes_off_and_lands(tmp_path: Path) -> None:
    said: list[str] = []
    with linked_vehicle(tmp_path, "--ready-after", "0.5", "--estimate", "high") as (vehicle, link):
        pilot = Pilot(link, said.append, hover_s=8.0)
        pilot.prepare()
        assert not pilot.is_flying()
        pilot.take_off(1.5)
        assert pilot.is_flying()
        height_m = 0.08 - vehicle.events("pose")[-1]["position"][2]
        assert 0.9 < height_m < 2.1  # its estimate of the height is off by 0.1 m (one deviation)
        pilot.land()
        link.wait_for("EXTENDED_SYS_STATE", 2.5, lambda m: m.landed_state == 1)
        assert not pilot.is_flying()
    assert said[0] == (
        "the pilot changes COM_OF_LOSS_T from 1 to 0.5 and COM_OBL_RC_ACT from 0 to 5"
    )


def test_what_is_set_already_is_not_told(tmp_path: Path) -> None:
    said: list[str] = []
    with linked_vehicle(tmp_path, "--ready-after", "0.5") as (_, link):
        Pilot(link).prepare()
        Pilot(link, log=said.append).prepare()
    assert said == []


def test_refused_arming_names_the_reason_and_the_parameters_that_may_help(tmp_path: Path) -> None:
    with linked_vehicle(tmp_path, "--ready-after", "60") as (_, link):
        link.wait_for_vehicle(30.0)
        with pytest.raises(PilotError) as refused:
            Pilot(link, arming_s=1.0).arm()
    message = str(refused.value)
    assert "Arming denied: preflight checks fail" in message
    for name in ("COM_RC_IN_MODE", "NAV_RCL_ACT", "NAV_DLL_ACT"):
        assert name in message
