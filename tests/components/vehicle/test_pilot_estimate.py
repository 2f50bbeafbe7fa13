"""The pilot beside a vehicle with PX4's default sensor noise, and one that will not arm."""

from pathlib import Path

import pytest
from vehicle_process import linked_vehicle

from dfvs_sim.ground.pilot import Pilot, PilotError

pytestmark = pytest.mark.real_time


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
        link.wait_for("HEARTBEAT", 30.0)
        with pytest.raises(PilotError) as refused:
            Pilot(link, arming_s=1.0).arm()
    message = str(refused.value)
    assert "Arming denied: preflight checks fail" in message
    for name in ("COM_RC_IN_MODE", "NAV_RCL_ACT", "NAV_DLL_ACT"):
        assert name in message
