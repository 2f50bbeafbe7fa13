"""MAVLink URLs: what MAVSDK takes, and what each part says."""

from pathlib import Path

import pytest

from dfvs_core.errors import ConfigError
from dfvs_service.settings.config import load_config
from dfvs_service.settings.mavlink_url import MavlinkUrl

BY_PATH = "/dev/serial/by-path/pci-0:14.0-usb-0:1:1.0"


@pytest.mark.parametrize(
    ("url", "device"),
    [
        ("serial:///dev/ttyACM0:921600", "/dev/ttyACM0"),
        ("serial_flowcontrol:///dev/ttyS1:57600", "/dev/ttyS1"),
        (f"serial://{BY_PATH}:57600", BY_PATH),
        ("udpin://127.0.0.1:14540", None),
    ],
)
def test_the_device_of_a_connection_is_all_before_the_baud_rate(url, device):
    assert MavlinkUrl.parse(url).device == (None if device is None else Path(device))


@pytest.mark.parametrize(
    ("url", "private"),
    [
        ("udpin://127.0.0.1:14540", True),
        ("udpout://localhost:14540", True),
        ("serial:///dev/ttyACM0:921600", True),
        ("serial_flowcontrol:///dev/ttyS1:57600", True),
        ("udp://:14540", False),
        ("udpin://0.0.0.0:14540", False),
        ("udpout://192.168.1.9:14550", False),
        ("tcpout://10.0.0.1:5760", False),
    ],
)
def test_mavlink_is_private_on_a_serial_line_or_on_loopback(url, private):
    assert MavlinkUrl.parse(url).is_private is private


@pytest.mark.parametrize(
    "url",
    [
        "/dev/ttyACM0",
        "tty://x",
        "raw://",
        "serialport:///dev/ttyACM0:57600",
        "serial:///dev/ttyACM0",
        "serial://ttyACM0:57600",
        "udpin://abc",
        "udpin://127.0.0.1",
        "udpin://127.0.0.1:x",
        "udpin://127.0.0.1:0",
        "udpin://127.0.0.1:65536",
        "udpin://127.0.0.1:14540/",
        "udpin://localhost:14540",
        "udpin://:14540",
        "udpout://:14540",
        "tcpout://[::1]:5760",
    ],
)
def test_a_connection_that_mavsdk_does_not_take_is_refused_by_the_settings(url):
    with pytest.raises(ConfigError) as error:
        load_config(None, {"vehicle.mavlink": url})
    assert error.value.problem == f"vehicle.mavlink = {url!r}"
    assert "udpin://" in error.value.expected
    assert "serial://" in error.value.expected
    assert error.value.remedy
