"""One flight: where it begins, what of it is judged, and that its end loses nothing."""

import threading
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from built_in_room import built_in_room

from dfvs_core.geometry.arrays import FloatArray
from dfvs_core.geometry.camera import CameraModel
from dfvs_core.geometry.poses import invert_pose, pose_error
from dfvs_core.messages.goal import Mount
from dfvs_sim.demo.flight.flight import Flight, FlightError, running
from dfvs_sim.demo.flight.flight_log import FlightLog
from dfvs_sim.demo.flight.track import Track, TrackPoint
from dfvs_sim.demo.options import FlightOptions
from dfvs_sim.demo.plan import FlightPlan
from dfvs_sim.ground.pilot import PilotError
from dfvs_sim.ground.pose import VehiclePose
from dfvs_sim.ground.systems import LinkError
from dfvs_sim.vehicle.modes import Mode
from dfvs_sim.viewpoints.poses import CameraPoses, camera_pose

START, GOAL = camera_pose((0.3, -1.2, -1.3), 0.85), camera_pose((0.5, -1.0, -1.3), 0.7)
GROUND = VehiclePose(0, (2.0, 1.0, 0.1), 0.0, 0.0, 0.4)
TILT_RAD = 0.02
HOVER = VehiclePose(0, (2.5, 0.8, -1.0), TILT_RAD, 0.0, 0.5)
"""Half a metre and six degrees beside the place above the ground, and 0.2 m too low."""


class Vehicle:
    """Pilot and tracker of a vehicle that truly hovers beside where it took off."""

    def __init__(self, *poses: VehiclePose | None) -> None:
        self._ground, self._hover = poses
        self.climbed_m: float | None = None

    def take_off(self, height_m: float) -> None:
        self.climbed_m = height_m

    def pose_at(self, _: int) -> VehiclePose | None:
        return self._ground if self.climbed_m is None else self._hover

    def camera_poses(self, T_scene_local: FloatArray, T_body_camera: FloatArray) -> CameraPoses:
        def pose(_: int) -> FloatArray | None:
            at = self.pose_at(0)
            return None if at is None else T_scene_local @ at.T_local_body() @ T_body_camera

        return pose


@pytest.fixture
def flight(tmp_path: Path) -> Iterator[Flight]:
    camera = CameraModel.from_horizontal_fov(96, 72, 1.3)
    renderer = built_in_room()
    plan = FlightPlan(renderer, camera, Mount(), START, GOAL, 0)
    flight = Flight(plan, FlightOptions(), tmp_path, lambda _: None)
    yield flight
    flight._ports.close()  # as ``run`` does


def test_the_camera_hovers_at_the_start_but_for_its_tilt_and_the_scene_stays_upright(
    flight: Flight,
) -> None:
    vehicle: Any = Vehicle(GROUND, HOVER)
    T_scene_camera = flight.take_off(vehicle, vehicle)(0)
    assert T_scene_camera is not None
    assert pose_error(T_scene_camera, START) == pytest.approx((0.0, TILT_RAD), abs=1e-9)
    T_scene_body = T_scene_camera @ invert_pose(Mount().T_body_camera())
    T_scene_local = T_scene_body @ invert_pose(HOVER.T_local_body())
    np.testing.assert_allclose(T_scene_local[2, :3], [0.0, 0.0, 1.0], atol=1e-9)
    assert vehicle.climbed_m == pytest.approx(1.3, abs=0.02)  # above the scene's floor


def test_a_hover_that_is_not_known_is_an_error(flight: Flight) -> None:
    vehicle: Any = Vehicle(GROUND, None)
    with pytest.raises(FlightError, match="pose is not known"):
        flight.take_off(vehicle, vehicle)


def test_a_vehicle_that_may_be_a_real_one_is_neither_landed_nor_armed(
    flight: Flight, monkeypatch: pytest.MonkeyPatch
) -> None:
    class WithoutTruth:
        def start(self, _timeout_s: float) -> None: ...

        def require_truth(self) -> None:
            raise LinkError("no true pose")

    tracker: Any = WithoutTruth()
    pilot: Any = None  # is asked for nothing
    monkeypatch.setattr(flight, "_options", FlightOptions(autopilot="udpin://127.0.0.1:14540"))
    with pytest.raises(LinkError):
        flight._await_vehicle(pilot, tracker)


def test_a_vehicle_that_refuses_hold_at_the_end_loses_no_flight(
    flight: Flight, monkeypatch: pytest.MonkeyPatch
) -> None:
    class Refusing:
        def set_mode(self, _mode: Mode) -> None:
            raise PilotError("Hold was denied", "an accepted mode")

    said: list[str] = []
    monkeypatch.setattr(flight, "_log", said.append)
    pilot: Any = Refusing()
    flight._hold(pilot)
    assert said == ["the vehicle is not in Hold: Hold was denied; expected an accepted mode"]


def test_it_is_judged_up_to_a_second_after_its_end_from_when_on_the_pilot_flies() -> None:
    unused: Any = None
    second_ns = 10**9
    track = Track(unused, np.eye(4))
    track.points = [TrackPoint(k * second_ns // 10, np.eye(4), 0.01 * k, 0.0) for k in range(100)]
    span_ns = 2 * second_ns, 5 * second_ns
    log = FlightLog(unused, unused, track, unused, *span_ns, "DONE", "goal reached", None)
    judged_ns = [point.t_ns for point in log.judged]
    assert (judged_ns[0], judged_ns[-1]) == (2 * second_ns, 6 * second_ns)


def test_a_thread_that_is_interrupted_at_its_start_is_told_to_stop(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    stops: list[threading.Event] = []
    began = threading.Thread.start

    def start(thread: threading.Thread) -> None:
        began(thread)
        raise KeyboardInterrupt

    monkeypatch.setattr(threading.Thread, "start", start)
    with pytest.raises(KeyboardInterrupt), running(stops.append, "camera"):
        pytest.fail("it was interrupted before")
    (stop,) = stops
    assert stop.is_set()
