"""``dfvs-sim`` without a command: vehicle and camera together."""

from __future__ import annotations

import argparse
import contextlib
import signal
import subprocess
import sys
import time

_POLL_S = 0.2


def add_options(parser: argparse.ArgumentParser) -> None:
    """Make this what ``dfvs-sim`` does when no command is named."""
    parser.set_defaults(run=run)


def run(_args: argparse.Namespace) -> int:
    """Run the vehicle and the camera with their defaults until interrupted or one ends."""
    commands = [[sys.executable, "-m", "dfvs_sim.cli", name] for name in ("vehicle", "camera")]
    with contextlib.ExitStack() as stack:
        children = [stack.enter_context(subprocess.Popen(command)) for command in commands]
        signal.signal(signal.SIGTERM, lambda *_: _end(children))
        try:
            while all(child.poll() is None for child in children):
                time.sleep(_POLL_S)
        except KeyboardInterrupt:
            pass
        finally:
            _end(children)
    codes = [child.returncode for child in children]
    return max((code for code in codes if code is not None and code > 0), default=0)


def _end(children: list[subprocess.Popen[bytes]]) -> None:
    for child in children:
        if child.poll() is None:
            child.terminate()
