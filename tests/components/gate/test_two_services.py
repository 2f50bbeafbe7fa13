"""A second service on the same ports ends at once and takes nothing from the first one."""

import contextlib
import os
import re
import subprocess
import sys
import time
import tomllib

import cv2
import numpy as np
import psutil
import pytest
from gate_flight import hovering_vehicle, service_running
from loopback import free_endpoint, listening_peer
from vehicle_process import companion_connected, free_port

from dfvs_core.errors import DfvsError
from dfvs_service.settings.sections import ZenohSection
from dfvs_service.zenoh_session import open_session

pytestmark = pytest.mark.real_time


@pytest.fixture
def goal(tmp_path):
    path = tmp_path / "goal.png"
    image = np.random.default_rng(0).integers(0, 255, (48, 64, 3), dtype=np.uint8)
    cv2.imwrite(str(path), image)
    return path


def left_running(session):
    """Command lines of a session's processes that have not ended."""
    left = []
    for process in psutil.process_iter():
        with contextlib.suppress(ProcessLookupError, psutil.NoSuchProcess):
            is_ours = os.getsid(process.pid) == session
            if is_ours and process.status() != psutil.STATUS_ZOMBIE:
                left.append(process.cmdline())
    return left


def second_service(goal, endpoint, mavlink_port, *words):
    """What the user reads of a service that cannot run; nothing of it is left."""
    command = [sys.executable, "-m", "dfvs_service.cli", "--goal", str(goal), "--camera-fov", "80"]
    command += ["--model", "classical", "--mavlink", f"udpin://127.0.0.1:{mavlink_port}"]
    command += ["--set", f"zenoh.listen=['{endpoint}']", *words]
    service = subprocess.Popen(
        command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, start_new_session=True
    )
    out, err = service.communicate(timeout=60.0)
    assert (service.returncode, out) == (2, ""), err
    (line,) = err.splitlines()
    assert not left_running(service.pid)
    return line


@pytest.mark.parametrize("words", [(), ("--check",)], ids=["flight", "check"])
def test_a_zenoh_port_that_another_service_has_is_said_with_a_free_one(goal, words):
    with listening_peer() as (_, endpoint):
        line = second_service(goal, endpoint, free_port(), *words)
    port = endpoint.rsplit(":", 1)[1]
    assert line.startswith(f"error: TCP port {port} is taken by another program")
    assert re.search(r"--set 'zenoh\.listen=\[\"tcp/127\.0\.0\.1:\d+\"\]'", line)


def test_a_mavlink_port_that_another_service_has_is_said_and_stays_with_it(goal, tmp_path):
    """MAVSDK would share the port, and the newest of those that share it hears the autopilot."""
    with hovering_vehicle(tmp_path) as vehicle, companion_connected(vehicle.port) as system:
        ways = ((), ("--check",))
        lines = [second_service(goal, free_endpoint(), vehicle.port, *words) for words in ways]
        time.sleep(2.0)  # PX4's heartbeat comes once a second
        assert system.is_connected()
    for line in lines:
        assert line.startswith(f"error: UDP port {vehicle.port} is taken by another program")
        assert "--mavlink udpin://127.0.0.1:" in line


def test_a_session_on_a_taken_port_is_refused_with_one_that_opens():
    """Perception opens it seconds after the service looked at its ports."""
    with listening_peer() as (_, endpoint):
        with pytest.raises(DfvsError, match="is taken by another program") as refused:
            open_session(ZenohSection(listen=(endpoint,)))
        setting = re.search(r"--set 'zenoh\.(.*?)'", refused.value.remedy).group(1)
        with open_session(ZenohSection(listen=tuple(tomllib.loads(setting)["listen"]))):
            pass


def test_a_client_where_nobody_listens_is_told_so_and_what_to_start():
    endpoint = free_endpoint()
    with pytest.raises(DfvsError, match=f"nobody listens on {endpoint}; expected a running dfvs-"):
        open_session(ZenohSection("client", (endpoint,), ()))


def test_a_client_of_a_router_on_the_default_port_opens():
    """As docs/how-to/ros2.md says: a client listens on nothing, whatever zenoh.listen says."""
    with listening_peer() as (_, endpoint):
        open_session(ZenohSection("client", (endpoint,), (endpoint,))).close()


def test_a_port_that_is_taken_after_the_start_ends_the_service_with_one_error(tmp_path):
    """Camera and route recording connect by the same means as this gate."""
    with hovering_vehicle(tmp_path) as vehicle, companion_connected(vehicle.port) as system:
        with service_running(vehicle, tmp_path / "runtime") as flight:
            assert flight.end() == 2
        time.sleep(2.0)  # PX4's heartbeat comes once a second
        assert system.is_connected()
        assert not vehicle.events("mode_command")
    assert f"UDP port {vehicle.port} is taken" in flight.error()
