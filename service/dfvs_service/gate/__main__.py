"""``python -m dfvs_service.gate --runtime DIR``: started by the service, not by hand."""

import os
import shutil
import signal
import sys
import traceback
from pathlib import Path

from dfvs_common.lifecycle import EXIT_FAILED, ORPHANED, cannot_run
from dfvs_core.errors import DfvsError
from dfvs_core.gate.config import Engage
from dfvs_service.gate.autopilot import Autopilot
from dfvs_service.gate.process import GateProcess, SilentLink, start_autopilot
from dfvs_service.settings.config import config_from_json
from dfvs_service.settings.key_file import load_key
from dfvs_service.supervisor.child_process import begin_child, prefer_this_process


def main() -> int:
    """Run the gate; its standard input is the parent's pipe."""
    runtime = begin_child("dfvs_service.gate", __doc__)
    config = config_from_json(runtime.config.read_text(encoding="utf-8"))
    key_file = config.gate.command_key_file
    key = load_key(Path(key_file)) if key_file else None
    prefer_this_process()
    shutil.rmtree(runtime.gate_scratch, ignore_errors=True)
    runtime.gate_scratch.mkdir(exist_ok=True)
    os.environ["TMPDIR"] = str(runtime.gate_scratch)  # MAVSDK leaves folders behind
    gate = GateProcess(config, runtime, key, sys.stdin.fileno())
    signal.signal(signal.SIGTERM, gate.stop)
    signal.signal(ORPHANED, signal.SIG_IGN)  # the parent's pipe ends too, and tells it apart
    vehicle = config.vehicle
    autopilot = Autopilot(
        gate.emit,
        gate.note,
        allow_return=config.gate.allow_return,
        limits=config.gate_config().velocity,
        system_id=vehicle.system_id,
    )
    start_autopilot(
        lambda: autopilot.connect(vehicle.mavlink, vehicle.timeout_s),
        lambda: autopilot.watch(gate.on_device_lost),
        gate,
    )
    try:
        never = config.gate.engage is Engage.NEVER
        return gate.run(SilentLink(gate.note) if never else autopilot)
    finally:
        gate.close()


def run() -> None:
    """Run, print what a user can correct as one line, and end without waiting for any thread."""
    try:
        code = main()
    except DfvsError as error:
        code = cannot_run(error)
    except Exception as error:  # noqa: BLE001 - the one place; whatever it is, the end is silence
        traceback.print_exc()
        print(f"error: the gate failed and is silent ({error!r})", file=sys.stderr)
        code = EXIT_FAILED
    sys.stderr.flush()
    # MAVSDK's threads need not be waited for: nothing of theirs sends setpoints.
    os._exit(code)


if __name__ == "__main__":
    run()
