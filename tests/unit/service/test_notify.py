import socket

import pytest

from dfvs_service.supervisor.systemd_notify import Notifier


@pytest.fixture(params=["path", "abstract"])
def systemd(request, tmp_path):
    """systemd's end: the environment that it gives, and its socket."""
    name = str(tmp_path / "notify")
    listener = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM)
    listener.bind(name if request.param == "path" else f"\0{name}")
    listener.setblocking(False)
    yield {"NOTIFY_SOCKET": name if request.param == "path" else f"@{name}"}, listener
    listener.close()


def test_systemd_hears_of_start_life_and_end(systemd):
    environment, listener = systemd
    notifier = Notifier(environment)
    notifier.ready()
    notifier.alive()
    notifier.stopping()
    assert [listener.recv(100) for _ in range(3)] == [b"READY=1", b"WATCHDOG=1", b"STOPPING=1"]
    notifier.close()


def test_a_systemd_that_does_not_read_delays_nothing(systemd):
    environment, _ = systemd
    notifier = Notifier(environment)
    for _ in range(2000):
        notifier.alive()
    notifier.close()


@pytest.mark.parametrize("environment", [{}, {"NOTIFY_SOCKET": "/nowhere/at/all"}])
def test_without_systemd_nothing_happens(environment):
    notifier = Notifier(environment)
    notifier.ready()
    notifier.close()
