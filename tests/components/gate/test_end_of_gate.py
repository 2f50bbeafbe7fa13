"""The gate's end beside the parent's limit of a hang."""

import contextlib
import os
import signal
import time

import pytest

from dfvs_service.gate.process import GateProcess, SilentLink
from dfvs_service.settings.config import load_config
from dfvs_service.settings.runtime import RuntimeFolder

pytestmark = pytest.mark.real_time

HANG_S = 0.3


def test_a_stuck_disk_does_not_make_the_gates_end_a_hang(tmp_path):
    runtime = RuntimeFolder(tmp_path)
    paths = (runtime.gate_log, runtime.gate_inputs)
    with contextlib.ExitStack() as stack:

        def keep(descriptor):
            stack.callback(os.close, descriptor)
            return descriptor

        for path in paths:  # pipes that nobody reads
            os.mkfifo(path)
            keep(os.open(path, os.O_RDONLY | os.O_NONBLOCK))
        parent, alive = os.pipe()
        keep(alive)
        gate = GateProcess(load_config(None, {}), runtime, None, keep(parent))
        for path in paths:
            writer = keep(os.open(path, os.O_WRONLY | os.O_NONBLOCK))
            with contextlib.suppress(BlockingIOError):
                while True:
                    os.write(writer, b".")
        gate.stop(signal.SIGTERM, None)
        gate.run(SilentLink(gate.note))
        last_heartbeat = time.monotonic()
        gate.close()
        assert time.monotonic() - last_heartbeat < HANG_S
