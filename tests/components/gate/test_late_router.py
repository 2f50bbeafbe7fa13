"""A service that is a Zenoh client, and its router, which comes later."""

import pytest
from gate_flight import service_running
from loopback import free_endpoint

from dfvs_common.zenoh_session import open_session

pytestmark = pytest.mark.real_time


def test_a_service_waits_in_preflight_until_its_router_is_there(vehicle, tmp_path):
    endpoint = free_endpoint()
    settings = {"zenoh__mode": "client", "zenoh__connect": [endpoint]}
    with service_running(vehicle, tmp_path / "runtime", **settings) as flight:
        flight.until("PREFLIGHT")
        flight.wait(lambda: "warning: nobody listens on" in flight.errors())
        flight.settle(2.0)
        assert flight.states()[-1] == "PREFLIGHT"
        assert flight.parent.poll() is None
        with open_session("router", (), (endpoint,)):
            flight.until("SERVO")
