"""Two simulated vehicles that send to the same ground station."""

from pathlib import Path

import pytest
from vehicle_process import free_port, vehicle_running

from dfvs_sim.ground.link import GroundLink
from dfvs_sim.ground.pilot import Pilot
from dfvs_sim.ground.systems import LinkError, listen_for_systems
from dfvs_sim.ground.udp import Endpoint

pytestmark = pytest.mark.real_time


def test_the_pilot_flies_the_vehicle_with_its_system_id(tmp_path: Path) -> None:
    port, companion_port = free_port(), free_port()
    ports = ("--gcs-port", str(port), "--companion-port", str(companion_port))
    one, two = tmp_path / "one", tmp_path / "two"
    one.mkdir()
    two.mkdir()
    with (
        vehicle_running(one, *ports, "--ready-after", "0.5", "--system-id", "1") as first,
        vehicle_running(two, *ports, "--ready-after", "0.5", "--system-id", "2") as second,
    ):
        with (
            GroundLink(f"udpin://127.0.0.1:{port}") as link,
            pytest.raises(LinkError, match="systems 1 and 2"),
        ):
            link.wait_for_vehicle(30.0)
        with GroundLink(f"udpin://127.0.0.1:{port}", system_id=2) as link:
            pilot = Pilot(link)
            pilot.prepare()
            pilot.arm()
        companion = Endpoint(listens=True, host="127.0.0.1", port=companion_port)
        assert listen_for_systems(companion, 5.0) == {1, 2}
    assert any(event["armed"] for event in second.events("state"))
    assert not any(event["armed"] for event in first.events("state"))


def test_nobody_is_heard_on_a_silent_port() -> None:
    endpoint = Endpoint(listens=True, host="127.0.0.1", port=free_port())
    assert listen_for_systems(endpoint, 0.1) == set()
