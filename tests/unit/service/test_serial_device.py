"""Serial devices, with pseudo-terminals in their place."""

import os
import pty

import pytest

from dfvs_core.gate.states import GateState
from dfvs_service.gate.process import GateProcess, SilentLink
from dfvs_service.gate.serial_device import SerialDevice, SerialDeviceError, serial_path
from dfvs_service.settings.config import load_config
from dfvs_service.settings.runtime import RuntimeFolder

LOSS = SerialDeviceError("the serial device /dev/ttyACM0 was lost")


@pytest.mark.parametrize(
    ("url", "path"),
    [
        ("serial:///dev/ttyACM0:921600", "/dev/ttyACM0"),
        ("serial_flowcontrol:///dev/ttyS1:57600", "/dev/ttyS1"),
        ("serial:///dev/ttyACM0", "/dev/ttyACM0"),
        ("serial:///dev/serial/by-path/pci-0:14.0-usb-0:1:1.0:57600", None),
        ("udpin://127.0.0.1:14540", ""),
    ],
)
def test_the_device_of_a_connection_is_all_before_the_baud_rate(url, path):
    expected = "/dev/serial/by-path/pci-0:14.0-usb-0:1:1.0" if path is None else path
    assert str(serial_path(url) or "") == expected


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


def test_a_device_whose_descriptor_was_closed_is_lost():
    master, slave = pty.openpty()
    device = SerialDevice(serial_path(f"serial://{os.ttyname(slave)}:57600"))
    os.close(slave)
    assert device.is_lost()
    os.close(master)


def test_a_device_that_nobody_has_open_is_not_lost(tmp_path):
    assert not SerialDevice(tmp_path / "none").is_lost()


@pytest.fixture
def gate(tmp_path):
    read, write = os.pipe()
    gate = GateProcess(load_config(None, {}), RuntimeFolder(tmp_path), None, read)
    yield gate
    gate.close()
    os.close(read)
    os.close(write)


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
