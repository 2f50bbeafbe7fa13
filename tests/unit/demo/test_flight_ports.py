"""Ports of flights that are brought up at the same time."""

import socket
import subprocess
import sys

from dfvs_sim.demo.flight import ports as flight_ports
from dfvs_sim.demo.flight.ports import FlightPorts, any_port

NUMBERS = "p = FlightPorts.choose(); print(p.ground, p.companion, p.zenoh, p.dashboard, flush=True)"
OTHER_FLIGHT = f"from dfvs_sim.demo.flight.ports import FlightPorts; {NUMBERS}; input()"


def numbers(ports):
    return {ports.ground, ports.companion, ports.zenoh, ports.dashboard}


def test_two_flights_of_one_process_share_no_port():
    first, second = FlightPorts.choose(), FlightPorts.choose()
    try:
        assert not numbers(first) & numbers(second)
    finally:
        first.close()
        second.close()


def test_a_flight_of_another_process_shares_no_port_long_before_anything_listens():
    command = [sys.executable, "-c", OTHER_FLIGHT]
    with subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE) as other:
        taken = {int(word) for word in other.stdout.readline().split()}
        ports = FlightPorts.choose()
        other.communicate(b"\n", timeout=60)
    assert len(taken) == 4
    assert not taken & numbers(ports)
    ports.close()


def test_ports_are_free_again_after_a_flight(monkeypatch):
    """The preferred port is one that no flight beside this test would ask for."""
    preferred = any_port(socket.SOCK_STREAM)
    monkeypatch.setattr(flight_ports, "USUAL_ZENOH", preferred)
    for _ in range(2):
        flight = FlightPorts.choose()
        flight.close()
        assert flight.zenoh == preferred
