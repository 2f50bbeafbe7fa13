"""Signals while the mock camera waits for its vehicle."""

import os
import signal

import pytest
from vehicle_process import free_port

from dfvs_sim import cli
from dfvs_sim.ground.pose import PoseTracker


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_signal_ends_the_wait_for_the_vehicle(number, monkeypatch):
    def start(*_):
        os.kill(os.getpid(), number)
        raise AssertionError("the wait goes on")

    monkeypatch.setattr(PoseTracker, "start", start)
    with pytest.raises(SystemExit) as end:
        cli.main(["camera", "--mavlink", f"udpin://127.0.0.1:{free_port()}"])
    assert end.value.code == 128 + number
