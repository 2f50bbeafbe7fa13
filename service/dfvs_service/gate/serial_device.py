"""Serial device of a MAVLink connection: waiting for it, and noticing its loss.

MAVSDK opens a device once. After a hang-up, such as an unplugged USB cable, it never opens the
device again, though that may be back under the same name.
"""

import contextlib
import os
import select
import stat
import time
from collections.abc import Callable
from pathlib import Path

from dfvs_core.errors import DfvsError

_SCHEMES = frozenset({"serial", "serial_flowcontrol"})
_DESCRIPTORS = Path("/proc/self/fd")
_POLL_S = 0.2


class SerialDeviceError(DfvsError):
    """A serial device that is missing, may not be used, or was lost."""


def serial_path(url: str) -> Path | None:
    """Device of a MAVLink URL such as ``serial:///dev/ttyACM0:921600``, None for a network's."""
    scheme, _, rest = url.partition("://")
    if scheme not in _SCHEMES:
        return None
    path, _, baud_rate = rest.rpartition(":")
    return Path(path if path and baud_rate.isdecimal() else rest)


def wait_for_device(
    path: Path,
    timeout_s: float,
    now_s: Callable[[], float] = time.monotonic,
    sleep: Callable[[float], None] = time.sleep,
) -> None:
    """Wait until a device is there and may be used.

    Raises
    ------
    SerialDeviceError
        If that is not so within the time.
    """
    deadline_s = now_s() + timeout_s
    while (error := _unusable(path, timeout_s)) is not None:
        if now_s() >= deadline_s:
            raise error
        sleep(_POLL_S)


def _unusable(path: Path, timeout_s: float) -> SerialDeviceError | None:
    if not path.exists():
        return SerialDeviceError(
            f"there is no serial device {path} within {timeout_s:g} s",
            "one that is plugged in",
            "check vehicle.mavlink; `ls /dev/serial/by-id` lists the USB devices",
        )
    if not os.access(path, os.R_OK | os.W_OK):
        return SerialDeviceError(
            f"{path} may not be used",
            "a user in the group 'dialout'",
            "`sudo usermod -aG dialout USER`, then log in anew",
        )
    return None


class SerialDevice:
    """Device that this process, or a library in it, has open.

    Parameters
    ----------
    path : Path
        Name of the device, which may be a link.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self._number = _device_number(path)
        self._descriptor = None if self._number is None else _descriptor_of(self._number)

    def is_lost(self) -> bool:
        """Whether the open device hung up; False where no open descriptor of it was found."""
        if self._descriptor is None:
            return False
        if _device_number(self._descriptor) != self._number:
            return True  # it was closed
        poll = select.poll()
        poll.register(self._descriptor, 0)
        return bool(poll.poll(0))


def _descriptor_of(number: int) -> int | None:
    """Descriptor of this process that has the device open."""
    with contextlib.suppress(OSError):
        for name in os.listdir(_DESCRIPTORS):
            if _device_number(int(name)) == number:
                return int(name)
    return None


def _device_number(device: Path | int) -> int | None:
    """Number of a character device by its path or descriptor, None where it is none."""
    with contextlib.suppress(OSError):
        status = os.stat(device)
        if stat.S_ISCHR(status.st_mode):
            return status.st_rdev
    return None
