"""An autopilot on a pseudo-terminal that vanishes; prints the errors of a second one and the watch.

It is a process of its own, since MAVSDK may crash where it closes a device that hung up.
"""

import os
import pty
import threading
import tty

from pymavlink.dialects.v20 import development as mavlink

from dfvs_core.errors import DfvsError
from dfvs_service.gate.autopilot import Autopilot

PATIENCE_S = 30.0


def feed(master: int, stop: threading.Event) -> None:
    """Send an autopilot's heartbeats."""
    packer = mavlink.MAVLink(None, 1, 1)
    while not stop.wait(0.1):
        os.write(master, mavlink.MAVLink_heartbeat_message(2, 12, 29, 0, 3, 3).pack(packer))


def main() -> None:
    """Connect, watch, and take the device away."""
    master, slave = pty.openpty()
    tty.setraw(slave)
    name, stop = os.ttyname(slave), threading.Event()
    os.close(slave)
    feeding = threading.Thread(target=feed, args=(master, stop))
    feeding.start()
    url = f"serial://{name}:57600"
    autopilot = Autopilot(lambda _event: None, lambda *_: None)
    autopilot.connect(url, PATIENCE_S)
    print("connected", flush=True)
    try:
        Autopilot(lambda _event: None, lambda *_: None).connect(url, PATIENCE_S)
    except DfvsError as error:
        print(error, flush=True)
    threading.Timer(0.2, os.close, (master,)).start()
    stop.set()
    feeding.join()
    autopilot.watch(lambda error: print(error, flush=True))
    os._exit(0)


if __name__ == "__main__":
    main()
