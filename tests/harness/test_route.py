"""A route through a doorway in closed loop: perception whole, a vehicle that answers late."""

import itertools

import numpy as np
import pytest

from dfvs_core.camera import CameraModel
from dfvs_core.goal import Goal, GoalSidecar
from dfvs_core.matching.classical import ClassicalMatcher
from dfvs_core.poses import make_pose, pose_error, rotation_from_euler
from dfvs_core.wire.frame import Frame, PixelFormat, encode_frame
from dfvs_core.wire.link import GateStatus, VehicleState
from dfvs_service.config import load_config
from dfvs_service.perception.assembly import Clocks, build_eye
from dfvs_service.perception.eye import RawSample
from dfvs_service.perception.route_follower import RouteFollower
from dfvs_sim.camera.sensor import SensorNoise
from dfvs_sim.demo.cli import DOORWAY_ROUTE
from dfvs_sim.demo.plan import parse_camera_pose
from dfvs_sim.render.renderer import Renderer
from dfvs_sim.render.truth import visibility
from dfvs_sim.scene import two_rooms_path
from dfvs_sim.scene.glb import load_glb

CAMERA = CameraModel.from_horizontal_fov(320, 240, np.radians(75.0))
CLOCK = b"c" * 16
STEP_NS = 150_000_000
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
        self.T = poses[0] @ np.linalg.inv(self.T_body_camera)
        self.position = self.T[:3, 3].copy()
        self.yaw = float(np.arctan2(self.T[1, 0], self.T[0, 0]))
        self.velocity = np.zeros(4)
        self.rng = np.random.default_rng(1)
        self.noise = SensorNoise.make(CAMERA.size, 1.5, self.rng)
        self.now_ns, self.seq = 10**12, 0

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


@pytest.mark.slow
def test_three_goals_lead_through_the_doorway_and_only_the_last_is_reached(rooms, poses):
    sidecar = GoalSidecar(CAMERA)
    config, _ = load_config(None, {}).with_camera(CAMERA.size, sidecar)
    goals = [Goal(rooms.render(CAMERA, pose, antialias=True).image, sidecar) for pose in poses[1:]]
    flight = Flight(rooms, poses, sidecar.mount)
    clocks = Clocks(CLOCK, lambda: flight.now_ns, lambda: flight.now_ns)
    eye = build_eye(config, goals[0], ClassicalMatcher(), clocks)
    route = RouteFollower(config, goals)
    passed, reports = [], []
    while flight.now_ns < 10**12 + LONGEST_S * 1e9:
        eye.heed(GateStatus("SERVO", "", flight.state()))
        glance = eye.look(flight.sample())
        reports.append(route.amend(glance.report))
        if glance.outcome is not None:
            route.follow(eye, glance.outcome, flight.now_ns)
        eye.digest()
        if route.go_on(eye, flight.now_ns):
            passed.append(pose_error(flight.camera_pose(), poses[route.index]))
        if reports[-1].reached:
            break
        flight.follow(reports[-1].velocity)
    error_m, error_rad = pose_error(flight.camera_pose(), poses[-1])
    assert route.is_last, reports[-1]
    assert reports[-1].reached
    assert error_m < 0.05
    assert np.degrees(error_rad) < 1.0
    assert [report.reached for report in reports].count(True) == 1
    assert not any(report.lost for report in reports)
    # The first two goals were left near their own views, not at once and not only when reached.
    for distance_m, angle_rad in passed:
        assert distance_m < 0.45
        assert np.degrees(angle_rad) < 20.0
