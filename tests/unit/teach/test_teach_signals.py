"""Signals while a recording of a route waits for its vehicle."""

import os
import signal

import pytest

from dfvs_service import cli
from dfvs_service.route.vehicle_state import VehicleStateListener


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_signal_ends_the_wait_for_the_vehicle(number, tmp_path, monkeypatch):
    def connect(*_):
        os.kill(os.getpid(), number)
        raise AssertionError("the wait goes on")

    monkeypatch.setattr(VehicleStateListener, "connect", connect)
    lens = ("--set", "camera.horizontal_fov_deg=75", "--set", "flow.model=classical")
    size = ("--set", "camera.width=320", "--set", "camera.height=240")
    with pytest.raises(SystemExit) as end:
        cli.main(["teach", "--out", str(tmp_path / "route"), *lens, *size])
    assert end.value.code == 128 + number
