"""A serial MAVLink device that vanishes under MAVSDK, with a pseudo-terminal in its place."""

import subprocess
import sys
from pathlib import Path

import pytest

pytestmark = pytest.mark.real_time


def test_a_serial_device_is_nobody_elses_and_ends_the_watch_when_it_vanishes():
    script = Path(__file__).parent / "lost_device.py"
    ran = subprocess.run(
        [sys.executable, str(script)], capture_output=True, text=True, timeout=60.0, check=False
    )
    assert ran.returncode == 0, ran.stderr
    connected, taken, loss = ran.stdout.splitlines()
    assert connected == "connected"
    assert "is used by another program" in taken
    assert loss.startswith("the serial device /dev/pts/")
    assert "was lost" in loss
