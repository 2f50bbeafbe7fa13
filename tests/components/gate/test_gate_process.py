"""The real gate and parent processes, with MAVSDK, beside the simulated vehicle.

The vehicle records on its own side what reaches it. Times are monotonic and the same for all
processes of a machine.
"""

import contextlib
import itertools
import json
import math
import os
import signal
import subprocess
import time

import psutil
import pytest
from gate_flight import HoveringVehicle, hovering_vehicle, service_running, side_by_side, speed
from signed_commands import signed
from vehicle_process import free_port

from dfvs_core.gate.config import MS, S
from dfvs_core.gate.events import Action
from dfvs_robustness.harness.records import MODE_REPORTS

pytestmark = pytest.mark.real_time

KEY = b"0123456789abcdef0123456789abcdef"


def assert_limits(setpoints):
    """I1, on the vehicle's side; float32 on the wire rounds at 1e-7."""
    for before, after in itertools.pairwise(setpoints):
        vx, vy, vz = after["velocity"]
        assert after["mask"] == 0x5C7
        assert after["frame"] == 8
        assert math.hypot(vx, vy) <= 0.5 + 1e-6
        assert abs(vz) <= 0.3 + 1e-6
        assert abs(after["yaw_rate_rad_s"]) <= math.radians(20) + 1e-6
        if speed(after) > 0:
            change = math.dist(after["velocity"], before["velocity"])
            # One period of 20 ms; a late one may use up to 0.1 s.
            assert change <= 0.5 * 0.1 + 1e-6


@pytest.mark.serial
def test_a_flight_reaches_its_goal_and_keeps_every_invariant(vehicle, tmp_path):
    with service_running(vehicle, tmp_path, sees="--forward 0.25") as flight:
        assert flight.end(30.0) == 0
    setpoints = flight.setpoints()
    assert_limits(setpoints)
    times = [s["t_ns"] for s in setpoints]
    assert max(b - a for a, b in itertools.pairwise(times)) <= 150 * MS
    servo_ns = next(t["t_ns"] for t in flight.transitions() if t["target"] == "SERVO")
    done_ns = next(t["t_ns"] for t in flight.transitions() if t["target"] == "DONE")
    moving = [s["t_ns"] for s in setpoints if speed(s) > 0]
    # A datagram reaches the vehicle's record within milliseconds of being sent.
    assert servo_ns <= min(moving)
    assert max(moving) <= done_ns + 50 * MS
    assert flight.modes_asked() == ["OFFBOARD", "HOLD"]
    assert not vehicle.events("arm_command")
    chain = [(t["source"], t["target"]) for t in flight.transitions()]
    names = ["IDLE", "PREFLIGHT", "READY", "ENGAGE", "SERVO", "DONE"]
    assert chain == list(itertools.pairwise(names))
    assert all(t["cause"] for t in flight.transitions())


@pytest.mark.serial
def test_a_takeover_ends_in_silence_for_good_within_50_ms_of_being_told(vehicle, tmp_path):
    with service_running(vehicle, tmp_path, gate__exit_when_done=False) as flight:
        flight.until("SERVO").settle()
        ordered_ns = vehicle.order("mode LAND")
        flight.until("RELEASED")
        vehicle.order("mode HOLD")
        flight.settle(1.5)
        flight.parent.terminate()
        assert flight.end() == 1
    told = [e for kind in MODE_REPORTS for e in vehicle.events(kind, ordered_ns)]
    told_ns = min(e["t_ns"] for e in told if e["mode"] == "LAND")
    assert flight.states()[-1] == "RELEASED"
    assert not flight.setpoints(told_ns + 50 * MS)
    assert flight.modes_asked() == ["OFFBOARD"]


def test_a_failsafe_that_returns_to_launch_is_refused_unless_the_settings_allow_it(tmp_path):
    """PX4's default, COM_OBL_RC_ACT 0, is return-to-launch where no radio is heard."""
    told = "COM_OBL_RC_ACT is 0 (position, without a radio return)"
    with hovering_vehicle(tmp_path) as vehicle:
        vehicle.order("parameter COM_OBL_RC_ACT 0")
        with service_running(vehicle, tmp_path / "refused") as flight:
            flight.wait(lambda: told in flight.errors())
            flight.settle(2.0)  # a second of passing checks leads to READY
            assert flight.states() == ["PREFLIGHT"]
        with service_running(vehicle, tmp_path / "allowed", gate__allow_return=True) as flight:
            flight.until("SERVO")
            assert told in flight.errors()


def test_a_commander_on_the_other_link_is_seen_by_the_velocity_that_is_flown(tmp_path):
    """PX4 forwards no message that is for itself: its setpoints never reach the service's link."""
    with hovering_vehicle(tmp_path) as vehicle:
        with service_running(vehicle, tmp_path / "runtime") as flight:
            flight.until("SERVO").settle()
            intruded_ns = vehicle.order("intruder -0.5")
            assert flight.end() == 1
        last = flight.transitions()[-1]
        foreign = [e for e in vehicle.events("setpoint", intruded_ns) if e["link"] != "companion"]
    assert foreign
    assert (last["target"], last["cause"]) == ("ABORT", "another commander")
    assert last["detail"].startswith("the autopilot flies a velocity that is")
    # A heartbeat a second confirms OFFBOARD, three targets at 20 Hz follow; twice that when busy.
    assert last["t_ns"] - intruded_ns < 2 * 1.2 * S


def test_the_service_ends_with_a_takeover_if_it_is_to_end_with_the_flight(vehicle, tmp_path):
    with service_running(vehicle, tmp_path, gate__engage="pilot") as flight:
        flight.until("READY").settle(0.3)
        assert flight.setpoints()
        vehicle.order("mode OFFBOARD")
        flight.until("SERVO")
        vehicle.order("mode HOLD")
        assert flight.end() == 1
    assert flight.modes_asked() == []
    assert [t["cause"] for t in flight.transitions()][-3:] == [
        "pilot selected OFFBOARD",
        "OFFBOARD confirmed",
        "mode left OFFBOARD",
    ]
    assert list((tmp_path / "gate-scratch").iterdir())  # MAVSDK's, and no longer in /tmp


@pytest.mark.serial
def test_a_gate_that_dies_or_hangs_is_silent_at_once_and_not_restarted(tmp_path):
    side_by_side(lose_the_gate, tmp_path, ("SIGKILL", "SIGSTOP", "held GIL"))


def lose_the_gate(vehicle, folder, how):
    gate = "gil_holding_gate.py" if how == "held GIL" else ""
    with service_running(vehicle, folder, gate=gate) as flight:
        flight.until("SERVO").settle()
        assert speed(flight.setpoints()[-1]) > 0
        pid = flight.pid("gate")
        if how == "held GIL":
            hung_ns = time.monotonic_ns()
            (folder / "hold").touch()
        else:
            hung_ns = flight.signal("gate", signal.Signals[how])
        assert flight.end() == 1
        ended_ns = time.monotonic_ns()
        with pytest.raises(ProcessLookupError):
            os.kill(pid, 0)
    flight.settle(1.0)
    assert not flight.setpoints(hung_ns + 400 * MS)
    assert flight.states().count("PREFLIGHT") == 1
    if how != "SIGKILL":
        assert "the gate hung and was killed" in flight.errors()
        # 300 ms of missing heartbeats, then the end of the other processes.
        assert ended_ns - hung_ns < 3 * S


@pytest.mark.serial
def test_a_perception_that_dies_or_hangs_ends_in_zero_and_abort(tmp_path):
    side_by_side(lose_perception, tmp_path, ("SIGKILL", "SIGSTOP"))


def lose_perception(vehicle, folder, how):
    with service_running(vehicle, folder, gate__hold_s=1.0) as flight:
        flight.until("SERVO").settle()
        silent_ns = flight.signal("fake_perception", signal.Signals[how])
        assert flight.end(12.0) == 1
    # The last report's frame was captured 30 ms or more before the process was stopped.
    after = flight.setpoints(silent_ns + 270 * MS)
    assert after
    assert all(speed(s) == 0 for s in after)
    assert flight.states()[-2:] == ["HOLD", "ABORT"]
    assert flight.modes_asked() == ["OFFBOARD", "HOLD"]


@pytest.mark.serial
def test_sigterm_brakes_asks_for_hold_and_ends_within_two_seconds(vehicle, tmp_path):
    with service_running(vehicle, tmp_path) as flight:
        flight.until("SERVO").settle()
        flight.parent.terminate()
        told_ns = time.monotonic_ns()
        assert flight.end() == 1
        assert time.monotonic_ns() - told_ns <= 2 * S
    assert flight.modes_asked() == ["OFFBOARD", "HOLD"]
    after = flight.setpoints(told_ns + 100 * MS)
    assert all(speed(s) == 0 for s in after)
    assert flight.states()[-1] == "ABORT"


@pytest.mark.serial
def test_a_gate_whose_parent_dies_or_hangs_aborts(tmp_path):
    side_by_side(lose_the_parent, tmp_path, ("SIGKILL", "SIGSTOP"))


def lose_the_parent(vehicle, folder, how):
    with service_running(vehicle, folder) as flight:
        flight.until("SERVO").settle()
        pid = flight.pid("gate")
        lost_ns = time.monotonic_ns()
        flight.parent.send_signal(signal.Signals[how])
        flight.until("ABORT", 3.0)
        # One second without a sign of life when it hangs, at once when it is gone.
        limit_ns = 200 * MS if how == "SIGKILL" else 1400 * MS
        assert flight.transitions()[-1]["t_ns"] - lost_ns <= limit_ns
        assert flight.transitions()[-1]["cause"] == "parent process silent"
        flight.wait(lambda: flight.modes_asked() == ["OFFBOARD", "HOLD"])
        flight.wait(lambda: ended(pid), 3.0)
    assert all(speed(s) == 0 for s in flight.setpoints(lost_ns + limit_ns + 100 * MS))


def ended(pid):
    """Whether a process runs no more; an unreaped one does not count as running."""
    with contextlib.suppress(psutil.NoSuchProcess):
        return psutil.Process(pid).status() == psutil.STATUS_ZOMBIE
    return True


def test_a_signed_command_engages_and_a_repeated_one_does_not_count(vehicle, tmp_path):
    key_file = tmp_path / "key"
    key_file.write_bytes(KEY)
    key_file.chmod(0o600)
    settings = {"gate__engage": "command", "gate__command_key_file": str(key_file)}
    folder = tmp_path / "runtime"
    with service_running(vehicle, folder, **settings) as flight:
        flight.until("READY")
        order = signed(KEY, "drone1", Action.ENGAGE, (folder / "challenge").read_text()).decode()
        document = json.loads(order)
        forged = json.dumps({**document, "command": {**document["command"], "action": "abort"}})
        for text in (forged, order, order):
            before = len(commands(flight))
            (folder / "command.new").write_text(text)
            (folder / "command.new").rename(folder / "command")
            flight.wait(lambda n=before: len(commands(flight)) > n)
        flight.until("SERVO")
    assert commands(flight) == [
        "rejected: wrong signature, use the key of this vehicle (gate.command_key_file)",
        "accepted: engage",
        "repeated: accepted: engage",
    ]


def commands(flight):
    return [record["text"] for record in flight.log() if record["kind"] == "command"]


def test_no_camera_is_said_in_one_line_with_perceptions_reason(vehicle, tmp_path):
    with service_running(vehicle, tmp_path, sees="--blind", camera__timeout_s=1) as flight:
        assert flight.end() == 2
    assert "no usable camera frame within 1 s" in flight.error()
    assert "no camera frame on dfvs/drone1/camera" in flight.error()
    assert not flight.setpoints()


def test_no_vehicle_is_said_in_one_line(tmp_path):
    vehicle = HoveringVehicle(subprocess.Popen(["cat"], stdin=subprocess.PIPE, text=True), 0, None)
    url = f"udpin://127.0.0.1:{free_port()}"
    settings = {"vehicle__mavlink": url, "vehicle__timeout_s": 1}
    with service_running(vehicle, tmp_path, **settings) as flight:
        assert flight.end() == 2
    vehicle.process.kill()
    assert f"no vehicle heard on {url} within 1 s" in flight.error()
