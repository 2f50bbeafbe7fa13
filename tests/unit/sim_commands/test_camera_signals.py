"""Words that the mock camera refuses, and signals while it waits for its vehicle."""

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


@pytest.mark.parametrize(
    ("option", "value", "said"),
    [
        ("--rate", "nan", "--rate is nan; expected 0.1 to 240"),
        ("--noise", "-1", "--noise is -1; expected 0 to 255"),
        ("--seed", "-1", "--seed is -1"),
        ("--share", "65536", "--share is 65536; expected 1 to 65535"),
        ("--system-id", "0", "--system-id is 0; expected 1 to 250"),
        ("--vehicle", "A B", "vehicle name 'A B'"),
        ("--connect", "somewhere", "somewhere; expected an endpoint such as tcp/127.0.0.1:7447"),
    ],
)
def test_words_that_cannot_be_used_are_one_clear_line(option, value, said, refused):
    words = ("camera", "--mavlink", f"udpin://127.0.0.1:{free_port()}")
    assert said in refused(cli.main, *words, option, value)
