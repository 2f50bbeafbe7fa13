"""Serial devices, with pseudo-terminals in their place."""

import errno
import os
import pty
from pathlib import Path

import pytest

from dfvs_core.gate.states import GateState
from dfvs_service.gate.autopilot import Autopilot
from dfvs_service.gate.process import SilentLink
from dfvs_service.gate.serial_device import (
    SerialDevice,
    SerialDeviceError,
    wait_for_device,
)
from dfvs_service.settings.mavlink_url import MavlinkUrl

LOSS = SerialDeviceError("the serial device /dev/ttyACM0 was lost")


def test_a_device_is_lost_once_it_hangs_up_and_stays_so_when_its_name_is_back(tmp_path):
    master, slave = pty.openpty()
    name = tmp_path / "ttyACM0"
    name.symlink_to(os.ttyname(slave))
    device = SerialDevice(name)
    assert not device.is_lost()
    os.write(master, b"data that nobody has read")
    assert not device.is_lost()
    os.close(master)
    assert device.is_lost()
    again, other = pty.openpty()
    name.unlink()
    name.symlink_to(os.ttyname(other))
    assert device.is_lost()
    for descriptor in (slave, again, other):
        os.close(descriptor)


def test_a_device_that_another_program_has_is_refused_at_once():
    master, slave = pty.openpty()
    url = f"serial://{os.ttyname(slave)}:57600"
    SerialDevice(MavlinkUrl.parse(url).device)
    with pytest.raises(SerialDeviceError, match="used by another program"):
        Autopilot(lambda _event: None, lambda *_: None).connect(url, 60.0)
    for descriptor in (master, slave):
        os.close(descriptor)


class Clock:
    """A clock that sleep moves on; something may happen at a time."""

    def __init__(self, at_s=0.0, happens=lambda: None):
        self.now_s, self._at_s, self._happens = 0.0, at_s, happens

    def __call__(self):
        return self.now_s

    def sleep(self, seconds):
        self.now_s += seconds
        if self.now_s >= self._at_s:
            self._happens()


def test_a_missing_device_is_waited_for_and_then_named(tmp_path):
    clock, path = Clock(), tmp_path / "ttyACM0"
    with pytest.raises(SerialDeviceError) as error:
        wait_for_device(path, 10.0, clock, clock.sleep)
    assert f"no serial device {path}" in str(error.value)
    assert 10.0 <= clock.now_s < 11.0


def test_a_device_that_comes_in_time_is_used_at_once(tmp_path):
    path = tmp_path / "ttyACM0"
    clock = Clock(3.0, path.touch)
    wait_for_device(path, 10.0, clock, clock.sleep)
    assert 3.0 <= clock.now_s < 4.0


@pytest.mark.parametrize(
    ("code", "words"),
    [(errno.EACCES, "may not be used.*dialout"), (errno.EPERM, "cannot be opened.*DeviceAllow")],
)
def test_a_device_that_may_not_be_opened_is_told_with_what_allows_it(code, words, monkeypatch):
    def refused(*_):
        raise OSError(code, os.strerror(code))

    monkeypatch.setattr(os, "open", refused)  # root may use everything
    clock = Clock()
    with pytest.raises(SerialDeviceError, match=f"/dev/null {words}"):
        wait_for_device(Path("/dev/null"), 1.0, clock, clock.sleep)


def test_the_autopilots_connection_tells_a_missing_device(tmp_path):
    autopilot = Autopilot(lambda _event: None, lambda *_: None)
    with pytest.raises(SerialDeviceError, match="no serial device"):
        autopilot.connect(f"serial://{tmp_path}/none:57600", 0.0)


def test_a_gate_on_the_ground_ends_with_the_loss_of_its_device(gate):
    gate.on_device_lost(LOSS)
    with pytest.raises(SerialDeviceError, match="was lost"):
        gate.run(SilentLink(gate.note))


@pytest.mark.parametrize("state", ["ENGAGE", "SERVO", "HOLD", "DONE", "ABORT"])
def test_a_flight_is_ended_before_the_gate_ends_with_the_loss_of_its_device(gate, state):
    gate.on_device_lost(LOSS)
    gate._machine.state = GateState[state]
    gate._machine.stream.is_silent = False
    assert gate._ending(0) is None
    gate._machine.state = GateState.ABORT
    gate._machine.stream.is_silent = True
    with pytest.raises(SerialDeviceError):
        gate._ending(0)
