"""Poses from the true motion that a simulated vehicle sends."""

import math
from collections.abc import Callable, Iterable
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from pymavlink.dialects.v20 import development as mavlink
from vehicle_in_hand import VehicleInHand, hovering, setpoint

from dfvs_sim.dynamics.estimate_errors import EstimateGrade
from dfvs_sim.dynamics.wind import WindGrade
from dfvs_sim.ground.pose import PoseTracker, VehiclePose
from dfvs_sim.ground.systems import LinkError
from dfvs_sim.vehicle.messages.streams import GROUND
from dfvs_sim.vehicle.modes import Mode

DELAY_NS = 1_000_000
AHEAD_NS = 100_000_000
"""Time by which a pose is extrapolated with the velocity."""
TRUTH = "HIL_STATE_QUATERNION"


class LinkInHand:
    """The ground link's port, to a vehicle whose clock the test holds."""

    target = 1

    def __init__(self, vehicle: VehicleInHand, lost: Iterable[str] = ()) -> None:
        self.vehicle = vehicle
        self._lost = set(lost)
        self._read = len(vehicle.sent)
        self._take: Callable[[Any, int], None] = lambda message, t_ns: None
        self._names: set[str] = set()
        self._latest: dict[str, Any] = {}

    def subscribe(self, names: Iterable[str], take: Callable[[Any, int], None]) -> Any:
        self._names, self._take = set(names), take
        return lambda: None

    def wait_for_vehicle(self, timeout_s: float) -> None:
        self.run(0.1)

    def command(self, command: int, *params: float) -> int:
        result = self.vehicle.command(command, *params, link=GROUND)[-1]
        self.deliver()
        return result

    def request_stream(self, name: str, rate_hz: float) -> int:
        numbers = {m.msgname: m.id for m in mavlink.mavlink_map.values()}
        return self.command(mavlink.MAV_CMD_SET_MESSAGE_INTERVAL, numbers[name], 1e6 / rate_hz)

    def send(self, message: Any) -> None:
        self.vehicle.send(message, GROUND)

    def wait_for(self, name: str, timeout_s: float, since_ns: int = 0) -> Any:
        if since_ns:
            self._latest.pop(name, None)
        for _ in range(round(timeout_s / 0.02)):
            if name in self._latest:
                break
            self.run(0.02)
        return self._latest.get(name)

    def run(self, seconds: float, message: Any = None) -> None:
        """Let time pass and deliver what comes."""
        for _ in range(round(seconds / 0.02)):
            self.vehicle.run(0.02, message)
            self.deliver()

    def deliver(self) -> None:
        new = self.vehicle.sent[self._read :]
        self._read = len(self.vehicle.sent)
        for t_ns, link, message in new:
            name = message.get_type()
            if link != GROUND or name in self._lost:
                continue
            self._latest[name] = message
            if name in self._names:
                self._take(message, t_ns + DELAY_NS)


def tracked(vehicle: VehicleInHand, lost: Iterable[str] = ()) -> tuple[PoseTracker, LinkInHand]:
    link = LinkInHand(vehicle, lost)
    tracker = PoseTracker(link)  # type: ignore[arg-type]
    tracker.start(1.0)
    return tracker, link


def newest(tracker: PoseTracker) -> VehiclePose:
    t_ns = tracker.newest_ns()
    assert t_ns is not None
    pose = tracker.pose_at(t_ns)
    assert pose is not None
    return pose


def true_position(vehicle: VehicleInHand) -> tuple[float, float, float]:
    return vehicle.body.north_m, vehicle.body.east_m, vehicle.body.down_m


def errors(
    tracker: PoseTracker, link: LinkInHand, seconds: float, message: Any = None
) -> NDArray[np.float64]:
    """Position's error (n, 3) at each new sample, in m."""
    out = []
    for _ in range(round(seconds / 0.02)):
        link.run(0.02, message)
        t_ns, now = link.vehicle.now_ns + DELAY_NS, link.vehicle.body
        pose = tracker.pose_at(t_ns)
        assert pose is not None
        out.append(np.subtract(pose.position_m, (now.north_m, now.east_m, now.down_m)))
    return np.array(out)


def test_the_poses_are_the_true_ones_whatever_the_estimate() -> None:
    vehicle = hovering(estimate=EstimateGrade.HIGH)
    tracker, link = tracked(vehicle)
    wrong_m = errors(tracker, link, 10.0)
    # the message's intervals are 11, 8 and 1 mm wide; the way of a few ms comes on top
    assert np.abs(wrong_m).max() < 0.015
    pose, body = newest(tracker), vehicle.body
    assert pose.yaw_rad == pytest.approx(body.yaw_rad, abs=0.01)
    assert pose.roll_rad == pytest.approx(body.roll_rad, abs=0.01)
    e = vehicle.px4.flight.estimate
    assert math.dist((e.north_m, e.east_m, e.down_m), pose.position_m) > 0.1


@pytest.mark.parametrize("wind", [WindGrade.CALM, WindGrade.WINDY])
def test_the_resolution_does_not_make_the_camera_tremble(wind: WindGrade) -> None:
    vehicle = hovering(estimate=EstimateGrade.LOW, wind=wind)
    tracker, link = tracked(vehicle)
    link.run(0.5, setpoint())
    assert link.command(176, 1.0, *Mode.OFFBOARD.value) == 0
    wrong_m = np.concatenate(
        [errors(tracker, link, 5.0, setpoint(vx, vy)) for vx, vy in ((0.3, 0.1), (0.0, 0.0))]
    )
    steps_m = np.diff(wrong_m[50:], axis=0)
    # from one sample to the next, against steps of 11 mm: 0.3 mm is 0.02 px of a 240 px lens at 3 m
    assert float(np.sqrt(np.mean(steps_m**2))) < 0.0003
    assert float(np.abs(steps_m).max()) < 0.003


def test_the_velocity_is_finer_than_the_messages() -> None:
    vehicle = hovering(estimate=EstimateGrade.LOW)
    tracker, link = tracked(vehicle)
    wrong = []
    for _ in range(500):
        link.run(0.02)
        now, later = newest(tracker), tracker.pose_at(newest(tracker).t_ns + AHEAD_NS)
        assert later is not None
        north, east, _ = np.subtract(later.position_m, now.position_m) / (AHEAD_NS * 1e-9)
        wrong.append((north - vehicle.body.v_north_m_s, east - vehicle.body.v_east_m_s))
    # cut off to cm/s, a hover of this grade is told as rest: its 5 mm/s would be the error
    assert float(np.sqrt(np.mean(np.square(wrong[100:])))) < 0.002


@pytest.mark.parametrize("sent", [True, False])
def test_without_the_truth_the_poses_are_the_estimate(sent: bool) -> None:
    vehicle = hovering(estimate=EstimateGrade.HIGH)
    if not sent:
        del vehicle.px4.telemetry.builders[TRUTH]
    tracker, link = tracked(vehicle, lost=[TRUTH])
    link.run(2.0)
    e, pose = vehicle.px4.flight.estimate, newest(tracker)
    # a sample is up to 20 ms old, and moves at up to 0.5 m/s
    assert pose.position_m == pytest.approx((e.north_m, e.east_m, e.down_m), abs=0.015)
    with pytest.raises(LinkError, match="may be a real one"):
        tracker.require_truth()


def test_without_an_origin_the_estimated_position_places_the_truth() -> None:
    vehicle = hovering()
    tracker, link = tracked(vehicle, lost=["GPS_GLOBAL_ORIGIN"])
    tracker.require_truth()
    link.run(2.0)
    assert newest(tracker).position_m == pytest.approx(true_position(vehicle), abs=0.015)


def test_a_vehicle_without_a_pose_is_reported() -> None:
    with pytest.raises(LinkError, match="LOCAL_POSITION_NED"):
        tracked(VehicleInHand(), lost=["LOCAL_POSITION_NED"])


def test_the_truth_is_asked_for_again_where_it_ends() -> None:
    vehicle = hovering()
    tracker, link = tracked(vehicle)
    link.run(0.5)
    vehicle.px4.links[GROUND].schedule.set_interval(TRUTH, -1.0, vehicle.now_ns)  # a new start
    link.run(3.0)
    pose = tracker.pose_at(vehicle.now_ns)
    assert pose is not None
    assert pose.position_m == pytest.approx(true_position(vehicle), abs=0.015)
