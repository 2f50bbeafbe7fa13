"""A route through a doorway in closed loop: perception whole, a vehicle that answers late."""

import itertools

import numpy as np
import pytest
from at_once import AtOnce

from dfvs_core.geometry.camera import CameraModel
from dfvs_core.geometry.poses import make_pose, pose_error, rotation_from_euler
from dfvs_core.matching.classical import classical_matcher
from dfvs_core.messages.frame import Frame, PixelFormat, encode_frame
from dfvs_core.messages.goal import Goal, GoalSidecar
from dfvs_core.messages.link import GateStatus, VehicleState
from dfvs_core.perception.route import RouteRecordingLimits
from dfvs_service.frames import RawSample
from dfvs_service.perception.assembly import Clocks, build_frame_processor
from dfvs_service.perception.route_follower import RouteFollower
from dfvs_service.route.recording import Event, RouteRecorder, route_recording_settings
from dfvs_service.settings.config import load_config
from dfvs_service.settings.goal_file import load_goal, route_images
from dfvs_sim.camera.sensor import SensorNoise
from dfvs_sim.demo.runs import DOORWAY_ROUTE
from dfvs_sim.options import parse_camera_pose
from dfvs_sim.render.renderer import Renderer
from dfvs_sim.render.truth import visibility
from dfvs_sim.scene import two_rooms_path
from dfvs_sim.scene.glb import load_glb
from dfvs_sim.viewpoints.poses import camera_pose

CAMERA = CameraModel.from_horizontal_fov(256, 192, np.radians(75.0))
CLOCK = b"c" * 16
STEP_NS = 200_000_000
LAG_S = 0.5
LONGEST_S = 60.0


@pytest.fixture(scope="module")
def rooms():
    return Renderer(load_glb(two_rooms_path()))


@pytest.fixture(scope="module")
def poses():
    """Start, and the goals in their order."""
    return [parse_camera_pose(text, "--goal") for text in DOORWAY_ROUTE]


def seen_share(rooms, first, second):
    """Share of the first view that the second one shows too."""
    depths = rooms.depth(CAMERA, first), rooms.depth(CAMERA, second)
    return float(visibility(CAMERA, (first, second), depths).mean())


def test_the_last_goal_is_out_of_sight_at_the_start_and_every_other_one_in_sight(rooms, poses):
    assert seen_share(rooms, poses[-1], poses[0]) < 0.005
    assert seen_share(rooms, poses[0], poses[-1]) < 0.005
    for before, after in itertools.pairwise(poses):
        assert seen_share(rooms, before, after) > 0.15
        assert seen_share(rooms, after, before) > 0.4


class Flight:
    """A level vehicle whose velocity follows what perception asks for, with a lag."""

    def __init__(self, rooms, poses, mount):
        self.rooms, self.T_body_camera = rooms, mount.T_body_camera()
        T = poses[0] @ np.linalg.inv(self.T_body_camera)
        self.position = T[:3, 3].copy()
        self.yaw = float(np.arctan2(T[1, 0], T[0, 0]))
        self.velocity = np.zeros(4)
        self.rng = np.random.default_rng(1)
        self.noise = SensorNoise.make(CAMERA.size, 1.5, self.rng)
        self.now_ns, self.seq = 10**12, 0

    def put(self, T_camera):
        """Stand at a camera pose, as if carried there."""
        T = T_camera @ np.linalg.inv(self.T_body_camera)
        self.position, self.yaw = T[:3, 3].copy(), float(np.arctan2(T[1, 0], T[0, 0]))
        self.now_ns += STEP_NS - 50_000_000

    def camera_pose(self):
        R = rotation_from_euler(0.0, 0.0, self.yaw)
        return make_pose(R, self.position) @ self.T_body_camera

    def state(self):
        world = rotation_from_euler(0.0, 0.0, self.yaw) @ self.velocity[:3]
        return VehicleState(
            self.now_ns, 0.0, 0.0, self.yaw, tuple(map(float, world)), tuple(self.position)
        )

    def sample(self):
        image = self.rooms.render(CAMERA, self.camera_pose()).image
        frame = Frame(self.noise.apply(image, self.rng), self.now_ns, self.seq)
        self.seq += 1
        return RawSample(*encode_frame(frame, PixelFormat.RGB8, CLOCK), self.now_ns)

    def follow(self, wanted):
        dt_s = STEP_NS * 1e-9
        self.velocity += (np.array(wanted) - self.velocity) * min(dt_s / LAG_S, 1.0)
        R = rotation_from_euler(0.0, 0.0, self.yaw)
        self.position += R @ self.velocity[:3] * dt_s
        self.yaw += float(self.velocity[3]) * dt_s
        self.now_ns += STEP_NS


class Outcome:
    """What became of a flight along a route."""

    def __init__(self, flight, route):
        self.flight, self.route = flight, route
        self.reports, self.passed = [], []


def flown(rooms, poses, goals):
    """Fly from the first of the poses by goals; ``poses`` after it are where they were taken."""
    config, _ = load_config(None, {}).with_camera(CAMERA.size, goals[0].sidecar)
    flight = Flight(rooms, poses, goals[0].sidecar.mount)
    clocks = Clocks(CLOCK, lambda: flight.now_ns, lambda: flight.now_ns)
    eye = build_frame_processor(config, goals[0], classical_matcher(), clocks)
    route = RouteFollower(config, goals, AtOnce())
    outcome = Outcome(flight, route)
    while flight.now_ns < 10**12 + LONGEST_S * 1e9:
        eye.on_gate_status(GateStatus("SERVO", "", flight.state()))
        glance = eye.process(flight.sample())
        outcome.reports.append(route.amend(glance.report))
        if glance.frame_result is not None:
            route.follow(glance.frame_result, flight.now_ns, engaged=True)
        eye.pipeline.work_between_frames()
        if route.go_on(eye.pipeline, flight.now_ns):
            outcome.passed.append(pose_error(flight.camera_pose(), poses[route.index]))
        if outcome.reports[-1].reached and not outcome.reports[-1].goals_left:
            break
        flight.follow(outcome.reports[-1].velocity)
    return outcome


def assert_arrived(outcome, T_last):
    error_m, error_rad = pose_error(outcome.flight.camera_pose(), T_last)
    assert outcome.route.is_last, outcome.reports[-1]
    assert outcome.reports[-1].reached
    assert error_m < 0.05
    assert np.degrees(error_rad) < 1.0
    assert not any(report.lost for report in outcome.reports)


@pytest.mark.slow
def test_three_goals_lead_through_the_doorway_and_only_the_last_is_reached(rooms, poses):
    sidecar = GoalSidecar(CAMERA)
    goals = [Goal(rooms.render(CAMERA, pose, antialias=True).image, sidecar) for pose in poses[1:]]
    outcome = flown(rooms, poses, goals)
    assert_arrived(outcome, poses[-1])
    # The first two goals were left near their own views, not at once.
    assert len(outcome.passed) == 2
    for distance_m, angle_rad in outcome.passed:
        assert distance_m < 0.45
        assert np.degrees(angle_rad) < 20.0


def along(poses, share):
    """Level camera pose at a share of the way through the poses."""
    i = min(int(share * (len(poses) - 1)), len(poses) - 2)
    s = share * (len(poses) - 1) - i
    headings = [np.arctan2(pose[1, 2], pose[0, 2]) for pose in poses]
    place = poses[i][:3, 3] * (1 - s) + poses[i + 1][:3, 3] * s
    return camera_pose(tuple(place), headings[i] * (1 - s) + headings[i + 1] * s)


@pytest.mark.slow
def test_a_route_that_was_taught_by_hand_is_flown_again(rooms, poses, tmp_path):
    config = route_recording_settings(load_config(None, {}), CAMERA)
    pilot = Flight(rooms, poses, GoalSidecar(CAMERA).mount)
    clocks = Clocks(CLOCK, lambda: pilot.now_ns, lambda: pilot.now_ns)
    teacher = RouteRecorder(config, tmp_path, classical_matcher(), clocks, RouteRecordingLimits())
    for share in np.linspace(0.0, 1.0, 36):
        pilot.put(along(poses, share))
        teacher.on_vehicle_states([pilot.state()], on_ground=False)
        pilot.now_ns += 50_000_000
        teacher.on_vehicle_states([pilot.state()], on_ground=False)
        event = teacher.process(pilot.sample())
        assert event is not Event.LOST
    assert teacher.finish() or event is Event.SAVED
    goals = [load_goal(path) for path in route_images([tmp_path])]
    assert 3 <= len(goals) <= 8
    taught = [poses[0]] * (len(goals) + 1)  # where the goals are plays no part in flying by them
    assert_arrived(flown(rooms, taught, goals), poses[-1])
