"""What the gate's MAVSDK connection keeps watching: parameters, flags, setpoints of others."""

import functools
import queue
import socket
import statistics
import time

import pytest
from gate_flight import hovering_vehicle
from mavsdk import LogLevel
from pymavlink.dialects.v20 import development as mavlink
from watching import watched_autopilot

from dfvs_core.gate.events import (
    CurrentMode,
    EstimatorState,
    ForeignSetpoint,
    ParametersRead,
    VehicleMode,
)
from dfvs_service.gate import autopilot as module
from dfvs_service.gate.autopilot import Autopilot

pytestmark = pytest.mark.real_time

PATIENCE_S = 60.0


class Heard:
    """Events as they come."""

    def __init__(self):
        self._events = queue.Queue()

    def __call__(self, event):
        self._events.put(event)

    def wait(self, kind, fits=lambda _event: True, meanwhile=lambda: None):
        deadline = time.monotonic() + PATIENCE_S
        while time.monotonic() < deadline:
            meanwhile()
            try:
                event = self._events.get(timeout=0.1)
            except queue.Empty:
                continue
            if isinstance(event, kind) and fits(event):
                return event
        raise AssertionError(f"no {kind.__name__} as wanted within {PATIENCE_S} s")


@pytest.fixture(scope="module")
def watched(tmp_path_factory):
    patch = pytest.MonkeyPatch()
    patch.setattr(module, "_READ_EVERY_S", 0.3)
    heard, notes = Heard(), []
    with hovering_vehicle(tmp_path_factory.mktemp("vehicle")) as vehicle:
        autopilot = Autopilot(heard, lambda kind, text: notes.append((kind, text)))
        autopilot.connect(f"udpin://127.0.0.1:{vehicle.port}", PATIENCE_S)
        with watched_autopilot(autopilot, notes.append):
            yield vehicle, heard, notes
    patch.undo()


def test_estimator_flags_come_as_often_as_they_were_asked_for(watched):
    _, heard, _ = watched
    heard.wait(EstimatorState)
    heard.wait(ParametersRead, lambda read: not read.refusals)
    times = [heard.wait(EstimatorState).t_ns for _ in range(20)]
    assert (times[-1] - times[0]) / 19 < 0.5e9  # 20 Hz; without asking 1 Hz


def test_a_failsafe_that_changes_while_the_service_runs_is_read_again(watched):
    vehicle, heard, notes = watched
    vehicle.order("parameter COM_OBL_RC_ACT 7")
    read = heard.wait(ParametersRead, lambda read: read.refusals)
    assert "COM_OBL_RC_ACT is 7 (disarm)" in read.refusals[0]
    vehicle.order("parameter COM_OBL_RC_ACT 5")
    heard.wait(ParametersRead, lambda read: not read.refusals)
    assert not [text for kind, text in notes if kind == "ack" and "511" in text]


def test_a_change_of_mode_is_heard_long_before_the_next_heartbeat(watched):
    vehicle, heard, _ = watched
    heard.wait(CurrentMode)
    late_ns = []
    for mode in (VehicleMode.LAND, VehicleMode.HOLD) * 3:
        ordered_ns = vehicle.order(f"mode {mode}")
        late_ns.append(heard.wait(CurrentMode, lambda e, m=mode: e.mode is m).t_ns - ordered_ns)
    assert statistics.median(late_ns) < 0.25e9  # by heartbeats alone 0.5 s in the mean


def test_an_interval_that_is_refused_is_noted_once():
    notes = []
    autopilot = Autopilot(lambda _event: None, lambda kind, text: notes.append((kind, text)))
    for result in (4, 0, 4, 4):
        autopilot._on_ack(1, {"command": 511, "result": result})
    autopilot._on_ack(1, {"command": 176, "result": 1})
    autopilot._on_ack(1, {"command": 176, "result": 1})
    assert [text for _, text in notes] == ["command 511 result 4", *("command 176 result 1",) * 2]


def test_a_text_of_the_autopilot_is_noted_on_one_line_without_control_characters():
    """PX4 ends a text with a tab where it tells the same as an event too."""
    notes = []
    autopilot = Autopilot(lambda _event: None, lambda kind, text: notes.append((kind, text)))
    text = "MAVLink: warning: Arming denied:\tno \x1b[31mposition\t\r\n\x00"
    autopilot._on_log(LogLevel.WARN, text, None, 0)
    assert notes == [("mavsdk", "MAVLink: warning: Arming denied: no [31mposition")]


@pytest.mark.parametrize(("system", "component"), [(255, 190), (245, 191), (1, 196)])
def test_setpoints_of_any_other_system_are_heard(watched, system, component):
    """A ground station, another companion under its own id, and one under the vehicle's id."""
    vehicle, heard, _ = watched
    target = mavlink.MAVLink_set_position_target_local_ned_message(
        *(0, 1, 1, 8, 0x5C7), *(0.0, 0.0, 0.0), *(0.1, 0.0, 0.0), *(0.0, 0.0, 0.0), 0.0, 0.0
    )
    packed = target.pack(mavlink.MAVLink(None, system, component))
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sender:
        send = functools.partial(sender.sendto, packed, ("127.0.0.1", vehicle.port))
        fits = f"system {system}, component {component}"
        heard.wait(ForeignSetpoint, lambda event: fits in event.detail, send)
