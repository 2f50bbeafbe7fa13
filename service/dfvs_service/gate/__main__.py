"""``python -m dfvs_service.gate --runtime DIR``: started by the service, not by hand."""

from __future__ import annotations

import argparse
import os
import signal
import sys
from collections.abc import Sequence
from pathlib import Path

from dfvs_core.errors import DfvsError
from dfvs_service.config import config_from_json
from dfvs_service.gate.autopilot import Autopilot
from dfvs_service.gate.process import EXIT_CANNOT_RUN, GateProcess, start_autopilot
from dfvs_service.key_file import load_key
from dfvs_service.runtime import RuntimeFolder


def main(argv: Sequence[str] | None = None) -> int:
    """Run the gate; its standard input is the parent's pipe."""
    parser = argparse.ArgumentParser(prog="dfvs_service.gate", description=__doc__)
    parser.add_argument("--runtime", type=Path, required=True)
    runtime = RuntimeFolder(parser.parse_args(argv).runtime)
    config = config_from_json(runtime.config.read_text(encoding="utf-8"))
    key_file = config.gate.command_key_file
    key = load_key(Path(key_file)) if key_file else None
    gate = GateProcess(config, runtime, key, sys.stdin.fileno())
    signal.signal(signal.SIGTERM, gate.stop)
    # The terminal's Ctrl-C goes to all processes; the parent passes it on as SIGTERM.
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    autopilot = Autopilot(gate.emit, gate.note)
    vehicle = config.vehicle
    start_autopilot(
        lambda: autopilot.connect(vehicle.mavlink, vehicle.timeout_s), autopilot.prepare, gate.fail
    )
    try:
        return gate.run(autopilot)
    finally:
        gate.close()


def run() -> None:
    """Run, print what a user can mend as one line, and end without waiting for any thread."""
    try:
        code = main()
    except DfvsError as error:
        print(f"error: {error}", file=sys.stderr)
        code = EXIT_CANNOT_RUN
    sys.stderr.flush()
    # MAVSDK's threads need not be waited for: nothing of theirs sends setpoints.
    os._exit(code)


if __name__ == "__main__":
    run()
