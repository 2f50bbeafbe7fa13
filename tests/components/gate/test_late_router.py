"""A service that is a Zenoh client, and its router, which comes later."""

import socket
import threading

import pytest
from gate_flight import service_running
from loopback import free_endpoint

from dfvs_common.zenoh_session import open_session
from dfvs_service.operator_link.process import OperatorLink
from dfvs_service.settings.config import load_config
from dfvs_service.settings.runtime import RuntimeFolder


@pytest.mark.real_time
def test_a_service_waits_in_preflight_until_its_router_is_there(vehicle, tmp_path):
    endpoint = free_endpoint()
    settings = {"zenoh__mode": "client", "zenoh__connect": [endpoint]}
    with service_running(vehicle, tmp_path / "runtime", **settings) as flight:
        flight.until("PREFLIGHT")
        flight.wait(lambda: "warning: Zenoh cannot be opened" in flight.errors())
        flight.settle(2.0)
        assert flight.states()[-1] == "PREFLIGHT"
        assert flight.parent.poll() is None
        with open_session("router", (), (endpoint,)):
            flight.until("SERVO")


def test_an_operator_link_ends_at_once_while_a_router_does_not_answer(tmp_path):
    with socket.create_server(("127.0.0.1", 0)) as silent:
        endpoint = f"tcp/127.0.0.1:{silent.getsockname()[1]}"
        config = load_config(None, {"zenoh.mode": "client", "zenoh.connect": [endpoint]})
        link = OperatorLink(config, RuntimeFolder(tmp_path))
        thread = threading.Thread(target=link.run, daemon=True)
        thread.start()
        connection, _ = silent.accept()
        link.stop(0, None)
        thread.join(2.0)  # Zenoh gives up after 10 s
        connection.close()
        assert not thread.is_alive()
