import threading

import pytest

from dfvs_sim.demo.flight.flight import running


def test_a_thread_that_is_interrupted_at_its_start_is_told_to_stop(monkeypatch):
    stops = []

    def start(thread):
        began(thread)
        raise KeyboardInterrupt

    began = threading.Thread.start
    monkeypatch.setattr(threading.Thread, "start", start)
    with pytest.raises(KeyboardInterrupt), running(stops.append, "camera"):
        pytest.fail("it was interrupted before")
    (stop,) = stops
    assert stop.is_set()
