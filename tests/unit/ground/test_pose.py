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
