"""Poses at a time of this machine's clock, from telemetry with the vehicle's stamps."""

import math

import numpy as np
import pytest
from pymavlink.dialects.v20 import development as mavlink

from dfvs_core.geometry.poses import euler_from_rotation
from dfvs_sim.ground.link import GroundLink
from dfvs_sim.ground.pose import PoseTracker
from dfvs_sim.ground.truth import LocalOrigin
from dfvs_sim.vehicle.messages.earth import attitude_quaternion

MS = 1_000_000
BOOT_NS = 7_000_000_000
"""Local time at which the vehicle's clock was zero."""


@pytest.fixture
def tracker(link: GroundLink) -> PoseTracker:
    return PoseTracker(link)


def place(ms: int, x: float, vx: float = 0.0) -> mavlink.MAVLink_message:
    return mavlink.MAVLink_local_position_ned_message(ms, x, 2.0, -3.0, vx, 0.0, 0.0)


def turn(ms: int, yaw: float, rate: float = 0.0, pitch: float = 0.0) -> mavlink.MAVLink_message:
    q = attitude_quaternion(0.0, pitch, yaw)
    return mavlink.MAVLink_attitude_quaternion_message(ms, *q, 0.0, 0.0, rate)


def feed(tracker: PoseTracker, message: mavlink.MAVLink_message, delay_ns: int = 0) -> None:
    tracker.on_message(message, BOOT_NS + message.time_boot_ms * MS + delay_ns)


def test_a_pose_between_samples_is_interpolated(tracker: PoseTracker) -> None:
    for ms, x, yaw in ((1000, 1.0, 0.1), (1020, 1.2, 0.3)):
        feed(tracker, place(ms, x))
        feed(tracker, turn(ms, yaw))
    pose = tracker.pose_at(BOOT_NS + 1005 * MS)
    assert pose is not None
    assert pose.position_m == pytest.approx((1.05, 2.0, -3.0), abs=1e-6)
    assert pose.yaw_rad == pytest.approx(0.15, abs=1e-4)


def test_a_pose_just_beyond_the_samples_is_extrapolated(tracker: PoseTracker) -> None:
    for ms, x, yaw in ((1000, 1.0, 0.1), (1020, 1.02, 0.11)):
        feed(tracker, place(ms, x, vx=1.0))
        feed(tracker, turn(ms, yaw, rate=0.5))
    pose = tracker.pose_at(BOOT_NS + 1050 * MS)
    assert pose is not None
    assert pose.position_m[0] == pytest.approx(1.05, abs=1e-6)
    assert pose.yaw_rad == pytest.approx(0.125, abs=1e-4)


def test_heading_is_mixed_the_short_way_round(tracker: PoseTracker) -> None:
    for ms, yaw in ((1000, math.pi - 0.05), (1020, -math.pi + 0.05)):
        feed(tracker, place(ms, 1.0))
        feed(tracker, turn(ms, yaw))
    pose = tracker.pose_at(BOOT_NS + 1010 * MS)
    assert pose is not None
    assert abs(pose.yaw_rad) == pytest.approx(math.pi, abs=1e-6)


def test_stale_and_bygone_times_have_no_pose(tracker: PoseTracker) -> None:
    assert tracker.pose_at(BOOT_NS) is None
    assert tracker.newest_ns() is None
    for ms in (1000, 1020):
        feed(tracker, place(ms, 1.0))
        feed(tracker, turn(ms, 0.0))
    assert tracker.newest_ns() == BOOT_NS + 1020 * MS
    assert tracker.pose_at(BOOT_NS + 999 * MS) is None
    assert tracker.pose_at(BOOT_NS + 1220 * MS) is not None
    assert tracker.pose_at(BOOT_NS + 1221 * MS) is None


def fly_at(tracker: PoseTracker, rate: float, seconds: int) -> tuple[float, list[float]]:
    """Share of a camera's frames that have a pose, and their errors in m, at 1 m/s to the north.

    The vehicle's clock runs at ``rate`` of real time; the first 4 s tell the rate.
    """
    rng = np.random.default_rng(0)
    frames, errors_m = 0, []
    for made_ms in range(0, seconds * 1000, 20):
        vehicle_ms = round(made_ms * rate)
        arrival_ns = BOOT_NS + made_ms * MS + round(3 * MS * rng.random())
        tracker.on_message(place(vehicle_ms, vehicle_ms * 1e-3, vx=1.0), arrival_ns)
        tracker.on_message(turn(vehicle_ms, 0.0), arrival_ns)
        if made_ms > 4000:
            frames += 1
            ahead_ms = 50
            pose = tracker.pose_at(BOOT_NS + (made_ms + ahead_ms) * MS)
            if pose is not None:
                errors_m.append(pose.position_m[0] - (made_ms + ahead_ms) * 1e-3 * rate)
    return len(errors_m) / frames, errors_m


@pytest.mark.parametrize("rate", [0.5, 0.6, 0.8, 0.9, 1.0])
def test_every_frame_has_its_pose_beside_a_slow_simulation(
    tracker: PoseTracker, rate: float
) -> None:
    share, errors_m = fly_at(tracker, rate, seconds=30)
    assert share == 1.0
    assert max(abs(e) for e in errors_m) < 0.01  # 10 ms at 1 m/s


def true_path(tracker: PoseTracker, rate: float) -> list[float]:
    """Positions at moments of vehicle time, by a truth that comes 16 ms after what has a stamp."""
    tracker.follow_truth(LocalOrigin(0, 0, 0))
    path_m = []
    for ms in range(1000, 12_000):
        arrival_ns = BOOT_NS + round(ms * MS / rate)
        if ms % 20 == 0:
            tracker.on_message(place(ms, 0.0), arrival_ns)
            tracker.on_message(turn(ms, 0.0), arrival_ns)
        if ms % 20 == 16:
            tracker.on_message(true_state(ms * 1e-3), arrival_ns)
        if ms > 5000 and ms % 25 == 0:
            pose = tracker.pose_at(arrival_ns)
            path_m.append(math.nan if pose is None else pose.position_m[0])
    return path_m


@pytest.mark.parametrize("rate", [0.5, 0.7])
def test_the_truth_of_a_slow_simulation_is_followed(link: GroundLink, rate: float) -> None:
    slow, fast = (true_path(PoseTracker(link), r) for r in (rate, 1.0))
    assert slow == pytest.approx(fast, abs=1e-3)  # 1 ms at 1 m/s


@pytest.mark.parametrize(("rate", "lines"), [(0.7, 1), (0.95, 0), (1.0, 0)])
def test_a_slow_simulation_is_said_once(link: GroundLink, rate: float, lines: int) -> None:
    said: list[str] = []
    fly_at(PoseTracker(link, log=said.append), rate, seconds=60)
    assert len(said) == lines
    assert all("0.70 of real time" in line for line in said)


def test_one_stop_of_the_simulation_is_not_said(link: GroundLink) -> None:
    said: list[str] = []
    tracker = PoseTracker(link, log=said.append)
    for ms in range(0, 20_000, 20):
        tracker.on_message(place(ms, 0.0), BOOT_NS + (ms + (900 if ms > 10_000 else 0)) * MS)
    assert said == []


def test_the_matrix_holds_position_and_attitude(tracker: PoseTracker) -> None:
    feed(tracker, place(1000, 1.0))
    feed(tracker, turn(1000, 0.4, pitch=-0.2))
    pose = tracker.pose_at(BOOT_NS + 1000 * MS)
    assert pose is not None
    T = pose.T_local_body()
    np.testing.assert_allclose(T[:3, 3], (1.0, 2.0, -3.0))
    np.testing.assert_allclose(euler_from_rotation(T[:3, :3]), (0.0, -0.2, 0.4), atol=1e-6)


def true_state(north_m: float) -> mavlink.MAVLink_message:
    lat = round(north_m / 111_319.5 * 1e7)
    no_rates, no_acceleration = (0.0, 0.0, 0.0), (0, 0, 0)
    return mavlink.MAVLink_hil_state_quaternion_message(
        0, (1.0, 0.0, 0.0, 0.0), *no_rates, lat, 0, 0, 100, 0, 0, 0, 0, *no_acceleration
    )


@pytest.mark.parametrize("stall_ms", [0, 30, 60, 100])
def test_a_true_pose_is_stamped_right_whatever_came_late_before_it(
    tracker: PoseTracker, stall_ms: int
) -> None:
    """The truth bears no stamp; 1 m/s to the north, and the thread is held up before a truth."""
    tracker.follow_truth(LocalOrigin(0, 0, 0))
    held_ms = 2002
    for ms in range(1000, 2400):
        arrival_ms = ms if not held_ms <= ms < held_ms + stall_ms else held_ms + stall_ms
        arrival_ns = BOOT_NS + arrival_ms * MS
        if ms % 20 == 0:
            tracker.on_message(place(ms, 0.0), arrival_ns)
        if ms % 20 == 4:
            tracker.on_message(true_state(ms * 1e-3), arrival_ns)
        if ms % 20 == 10:
            tracker.on_message(turn(ms, 0.0), arrival_ns)
        pose = tracker.pose_at(arrival_ns) if ms > 1500 else None
        if pose is not None and arrival_ms == ms:
            assert pose.position_m[0] == pytest.approx(ms * 1e-3, abs=0.013)
