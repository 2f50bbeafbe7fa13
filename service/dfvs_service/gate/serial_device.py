"""Serial device of a MAVLink connection: waiting for it, locking it, and noticing its loss.

MAVSDK shares a device with whoever opens it too, and each then gets a part of the bytes. It opens
a device once. After a hang-up, such as an unplugged USB cable, it never opens the device again,
though that may be back under the same name.
"""

import errno
import fcntl
import os
import select
import time
from collections.abc import Callable
from pathlib import Path

from dfvs_core.errors import DfvsError

_TAKEN = frozenset({errno.EWOULDBLOCK, errno.EBUSY})
_POLL_S = 0.2


class SerialDeviceError(DfvsError):
    """A serial device that is missing, may not be used, or was lost."""


class SerialDevice:
    """Serial device that is locked against other programs until this process ends.

    ``path`` may be a link.

    Raises
    ------
    OSError
        If it cannot be opened, or another program has it.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        descriptor = os.open(path, os.O_RDWR | os.O_NOCTTY | os.O_NONBLOCK)
        try:
            fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError:
            os.close(descriptor)
            raise
        self._poll = select.poll()
        self._poll.register(descriptor, 0)

    def is_lost(self) -> bool:
        """Whether the device hung up."""
        return bool(self._poll.poll(0))


def wait_for_device(
    path: Path,
    timeout_s: float,
    now_s: Callable[[], float] = time.monotonic,
    sleep: Callable[[float], None] = time.sleep,
) -> SerialDevice:
    """Wait until a device is there and may be used, and lock it.

    Raises
    ------
    SerialDeviceError
        If that is not so within the time; at once if another program has the device.
    """
    deadline_s = now_s() + timeout_s
    while True:
        try:
            return SerialDevice(path)
        except OSError as error:
            if error.errno in _TAKEN or now_s() >= deadline_s:
                raise _unusable(path, timeout_s, error) from error
        sleep(_POLL_S)


def device_fault(path: Path) -> SerialDeviceError | None:
    """Why a device cannot be used at present, if it is missing or forbidden; opens nothing."""
    if not path.exists():
        return _unusable(path, 0.0, FileNotFoundError())
    if not os.access(path, os.R_OK | os.W_OK):
        return _unusable(path, 0.0, PermissionError(errno.EACCES, ""))
    return None


def _unusable(path: Path, timeout_s: float, error: OSError) -> SerialDeviceError:
    if error.errno in _TAKEN:
        return SerialDeviceError(
            f"{path} is used by another program (maybe another dfvs-service)",
            remedy="end it, or name another device: --mavlink",
        )
    if isinstance(error, FileNotFoundError):
        waited = f" within {timeout_s:g} s" if timeout_s else ""
        return SerialDeviceError(
            f"there is no serial device {path}{waited}",
            "one that is plugged in",
            "check vehicle.mavlink; `ls /dev/serial/by-id` lists the USB devices",
        )
    if error.errno == errno.EACCES:
        return SerialDeviceError(
            f"{path} may not be used",
            "a user in the group 'dialout'",
            "`sudo usermod -aG dialout USER`, then log in anew",
        )
    return SerialDeviceError(
        f"{path} cannot be opened ({error.strerror})",
        "a serial device",
        "under systemd, does a DeviceAllow of the unit name its class?",
    )
