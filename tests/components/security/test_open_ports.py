"""What a running service listens on: what its settings declare, and nothing else."""

import json
import socket
import subprocess
import sys
from pathlib import Path

import numpy as np
import psutil
import pytest
from gate_flight import hovering_vehicle
from loopback import free_tcp_port
from waiting import until

from dfvs_core.geometry.camera import CameraModel
from dfvs_core.messages.goal import Goal, GoalSidecar
from dfvs_service.settings.config import load_config
from dfvs_service.settings.runtime import RuntimeFolder
from dfvs_service.supervisor.parent import prepare_runtime

RUNNER = Path(__file__).parents[1] / "gate" / "run_parent.py"
CAMERA = CameraModel.from_horizontal_fov(160, 120, 1.3)


@pytest.fixture
def service(tmp_path, rng):
    """Real gate and perception beside a vehicle; its processes and its declared ports."""
    zenoh_port, folder = free_tcp_port(), tmp_path / "r"
    folder.mkdir()
    with hovering_vehicle(tmp_path) as vehicle:
        overrides = {
            "vehicle.mavlink": f"udpin://127.0.0.1:{vehicle.port}",
            "zenoh.listen": [f"tcp/127.0.0.1:{zenoh_port}"],
            "gate.engage": "auto",
            "camera.timeout_s": 100,
        }
        sidecar = GoalSidecar(CAMERA)
        config, _ = load_config(None, overrides).with_camera((160, 120), sidecar)
        picture = rng.integers(0, 255, (120, 160, 3), dtype=np.uint8)
        runtime = RuntimeFolder(folder)
        prepare_runtime(runtime, config, Goal(picture, sidecar))
        command = [sys.executable, str(RUNNER), "--runtime", str(folder)]
        parent = subprocess.Popen(
            [*command, "--perception=-m dfvs_service.perception"], stderr=subprocess.DEVNULL
        )
        try:
            await_service(runtime, zenoh_port)
            family = [psutil.Process(parent.pid), *psutil.Process(parent.pid).children()]
            assert len(family) == 4
            yield family, zenoh_port, vehicle.port
        finally:
            parent.terminate()
            parent.wait(30.0)


def await_service(runtime, zenoh_port):
    """Wait until the operator link listens and the gate has heard its vehicle and its reports."""

    def is_up():
        with socket.socket() as probe:
            listens = probe.connect_ex(("127.0.0.1", zenoh_port)) == 0
        log = runtime.gate_log.read_text() if runtime.gate_log.exists() else ""
        states = [json.loads(line).get("target") for line in log.splitlines(keepends=False)]
        return listens and "PREFLIGHT" in states

    assert until(is_up, 40.0, poll_s=0.1)


def test_a_running_service_listens_on_nothing_but_what_is_declared(service):
    family, zenoh_port, mavlink_port = service
    listening, bound = set(), set()
    for process in family:
        for connection in process.net_connections("inet"):
            address = (connection.laddr.ip, connection.laddr.port)
            if connection.type == socket.SOCK_DGRAM:
                bound.add(address)
            elif connection.status == psutil.CONN_LISTEN:
                listening.add(address)
    assert listening == {("127.0.0.1", zenoh_port)}
    assert bound == {("127.0.0.1", mavlink_port)}
