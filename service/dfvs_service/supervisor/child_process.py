"""Entry point of child processes: ``python -m dfvs_service.NAME --runtime DIR``."""

import argparse
import contextlib
import os
import signal
from collections.abc import Callable
from pathlib import Path
from types import FrameType
from typing import Protocol

from dfvs_common.lifecycle import EXIT_OK, ORPHANED, cannot_run, end_with_parent
from dfvs_core.errors import DfvsError
from dfvs_service.settings.config import ServiceConfig, config_from_json
from dfvs_service.settings.runtime import RuntimeFolder

_NICE = -10


class ChildProcess(Protocol):
    """Work of a child process."""

    def stop(self, signal: int, frame: FrameType | None, /) -> None:
        """Signal handler of SIGTERM and ``ORPHANED``: end."""

    def run(self) -> None:
        """Work until told to stop."""


def begin_child(name: str, description: str | None = None) -> RuntimeFolder:
    """Read a child process's command line, and leave its end to its parent.

    A terminal's Ctrl-C and its closing reach all processes: the parent sends SIGTERM.
    """
    parser = argparse.ArgumentParser(prog=name, description=description)
    parser.add_argument("--runtime", type=Path, required=True)
    runtime = RuntimeFolder(parser.parse_args().runtime)
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    signal.signal(signal.SIGHUP, signal.SIG_IGN)
    end_with_parent(number=ORPHANED)
    return runtime


def run_child(name: str, make: Callable[[ServiceConfig, RuntimeFolder], ChildProcess]) -> int:
    """Run the child process of a package until SIGTERM, or until its parent is gone.

    ``make`` makes it from the settings and the runtime folder. Returns the exit code.
    """
    runtime = begin_child(name)
    try:
        process = make(config_from_json(runtime.config.read_text(encoding="utf-8")), runtime)
        for number in (signal.SIGTERM, ORPHANED):
            signal.signal(number, process.stop)
        process.run()
    except DfvsError as error:
        return cannot_run(error)
    return EXIT_OK


def prefer_this_process() -> None:
    """Ask the kernel to run this process before others; without the right to, change nothing.

    Both need little of the processor, but soon: perception may use up all of it. Rights come
    with systemd's ``Nice=`` or CAP_SYS_NICE.
    """
    with contextlib.suppress(PermissionError):
        os.setpriority(os.PRIO_PROCESS, 0, _NICE)
