"""The real gate process, with a thread that holds Python's lock once a file appears.

This is what a native library that does not return looks like from inside: every Python thread
stands still, native threads go on.
"""

import ctypes
import sys
import threading
import time
from pathlib import Path

from dfvs_service.gate.__main__ import run


def hold_when_told(trigger: Path) -> None:
    while not trigger.exists():
        time.sleep(0.005)
    ctypes.PyDLL(None).sleep(60)  # PyDLL keeps the lock while C code runs


if __name__ == "__main__":
    folder = Path(sys.argv[sys.argv.index("--runtime") + 1])
    threading.Thread(target=hold_when_told, args=[folder / "hold"], daemon=True).start()
    run()
