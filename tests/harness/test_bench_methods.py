"""Every method of the benchmark converges in the setting that its authors made it for."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from built_in_room import built_in_room
from depth_bundle import bundle

from dfvs_bench.methods.method import Decision, GoalObservation, Networks, Observation
from dfvs_bench.methods.pose_regression import PoseRegressionMethod
from dfvs_bench.methods.registry import METHODS
from dfvs_bench.trials.scenes import ASSETS
from dfvs_bench.trials.settings import wall
from dfvs_bench.trials.task import BenchTask
from dfvs_bench.trials.trial import goal_observation, run_trial
from dfvs_core.depth.depth_map import DepthMap
from dfvs_core.geometry.camera import CameraModel
from dfvs_core.geometry.poses import invert_pose, make_pose, se3_log, so3_exp
from dfvs_core.matching.classical import classical_matcher
from dfvs_core.messages.network_tensors import ImageInput
from dfvs_core.servo.exchange import Status
from dfvs_models.depth import DepthNetwork, fit_image
from dfvs_models.onnx_session import Execution
from dfvs_sim.render.renderer import Renderer
from dfvs_sim.viewpoints.poses import camera_pose

SMALL = CameraModel.from_horizontal_fov(160, 120, np.radians(75))
LARGE = SMALL.scaled(320, 240)
T_WORLD_GOAL = camera_pose((0.5, -1.0, -1.3), np.radians(40))


@pytest.fixture(scope="module")
def room():
    return built_in_room()


def task(distance_m, angle_deg, camera=SMALL):
    way, axis = np.array([0.6, -0.3, -0.74]), np.array([0.3, 0.8, -0.5])
    turn = so3_exp(axis / np.linalg.norm(axis) * np.radians(angle_deg))
    away = make_pose(turn, way / np.linalg.norm(way) * distance_m)
    return BenchTask("room", Path("room.glb"), T_WORLD_GOAL @ away, T_WORLD_GOAL, camera)


def servo(room, name, task, most_iterations, **networks):
    made_of = goal_observation(task, room), classical_matcher(), Networks(**networks)
    method = METHODS[name].make(*made_of)
    return run_trial(task, method, room, most_iterations)


@pytest.mark.parametrize(
    ("name", "camera"),
    [
        ("true-depth", SMALL),
        ("motion-depth", SMALL),
        ("flow-depth", LARGE),  # stops 4.1 cm away in pictures of half the size
    ],
)
def test_the_product_s_law_ends_at_the_goal_by_itself(room, name, camera):
    assert_ends_at_the_goal(servo(room, name, task(0.4, 12, camera), 80))


def assert_ends_at_the_goal(trial):
    assert trial.end == "done"
    assert trial.converged
    assert trial.iterations_to_criterion <= 45  # a gain of 0.1 alone takes 24
    assert trial.path_ratio < 1.15


@pytest.mark.parametrize("unit", ["1/m", "relative"])
@pytest.mark.parametrize("name", ["network-depth", "fused-depth"])
def test_by_a_depth_network_it_ends_at_the_goal_as_soon(room, name, unit):
    """By one whose depth is the true one, in metres or up to a factor."""
    there = task(0.4, 12)
    z_m = goal_observation(there, room).depth.z_m[::2, ::2]
    known = bundle((1.0 if unit == "1/m" else 0.3) / z_m, unit=unit)
    network = DepthNetwork(known, Execution(1))
    assert_ends_at_the_goal(servo(room, name, there, 80, depth=network))


def test_with_a_depth_of_3_m_everywhere_it_ends_near_the_goal(room):
    """The walls are at 1.5 m: sideways motion and yaw are told apart badly."""
    trial = servo(room, "constant-depth", task(0.4, 12), 80)
    assert trial.end == "done"
    assert trial.final.distance_m < 0.2
    assert trial.final.angle_rad < np.radians(3.0)


def test_photometric_servoing_is_exact_from_a_small_offset(room):
    trial = servo(room, "photometric", task(0.03, 1.5), 120)
    assert trial.end == "done"
    assert trial.final.distance_m < 0.001
    assert trial.final.angle_rad < np.radians(0.1)


def test_sift_servoing_converges_from_a_moderate_offset(room):
    trial = servo(room, "sift", task(0.3, 10), 80)
    assert trial.converged
    assert trial.path_ratio < 1.3


def test_position_based_servoing_goes_straight(room):
    trial = servo(room, "pnp", task(0.4, 12), 80)
    assert trial.end == "done"
    assert trial.converged
    assert trial.path_ratio < 1.1


BIAS = make_pose(so3_exp(np.array([0.01, -0.02, 0.03])), np.array([0.03, 0.0, -0.02]))


class KnownPose:
    """A network that knows the pose up to a bias, and the method that is told it."""

    def __init__(self, goal, unit, bias):
        self.unit, self._bias = unit, bias
        self._goal_m = self._in_unit(goal.depth)
        self._method = PoseRegressionMethod(goal, self)

    def _in_unit(self, depth):
        return 1.0 if self.unit == "m" else float(np.median(depth.z_m))

    def fit(self, image, camera):
        self._last = fit_image(image, camera, ImageInput(32, 24))
        return self._last

    def relative_pose(self, first, second):
        is_there = first is self._last
        T = self._T_current_goal if is_there else invert_pose(self._T_current_goal)
        T = T @ self._bias
        return make_pose(T[:3, :3], T[:3, 3] / (self._goal_m if is_there else self._current_m))

    def decide(self, sight):
        self._T_current_goal = invert_pose(sight.T_world_camera) @ T_WORLD_GOAL
        self._current_m = self._in_unit(sight.depth)
        return self._method.decide(sight)


@pytest.mark.parametrize("unit", ["m", "depth"])
def test_servoing_by_a_regressed_pose_ends_at_the_goal_whatever_the_bias(room, unit):
    there = task(0.4, 12)
    goal = goal_observation(there, room)
    trial = run_trial(there, KnownPose(goal, unit, BIAS), room, 120)
    assert trial.end == "done"
    assert trial.final.distance_m < 0.004
    assert trial.final.angle_rad < np.radians(0.2)
    assert trial.path_ratio < 1.1


@pytest.mark.parametrize("unit", ["m", "depth"])
def test_a_step_by_an_exact_pose_is_a_tenth_of_the_motion_to_a_goal_of_another_depth(unit):
    image = np.zeros((SMALL.height, SMALL.width, 3), np.uint8)
    near, far = (
        DepthMap(np.full(image.shape[:2], z, np.float32), np.ones(image.shape[:2], np.float32))
        for z in (1.5, 4.0)
    )
    T = task(0.4, 12).T_world_start
    exact = KnownPose(GoalObservation(SMALL, image, near), unit, np.eye(4))
    step = se3_log(exact.decide(Observation(0, image, far, T)).T_current_next)
    np.testing.assert_allclose(step, 0.1 * se3_log(invert_pose(T) @ T_WORLD_GOAL), atol=1e-9)


def test_the_siamese_network_ends_at_the_goal_before_a_plane(room):
    """Its authors' setting: a photograph 2 m away, seen from half of their displacement."""
    photograph = room.render(LARGE, T_WORLD_GOAL, antialias=True).image
    T_goal = camera_pose((0.0, 0.0, 0.0), 0.0)
    away = make_pose(so3_exp(np.radians([-6.0, 6.0, 15.0])), np.array([0.12, -0.12, 0.06]))
    there = BenchTask("wall", Path("wall.glb"), T_goal @ away, T_goal, SMALL)
    network = METHODS["bateux"].load(str(ASSETS / "bateux"))
    trial = servo(Renderer(wall(photograph)), "bateux", there, 60, pose=network.pose)
    assert trial.final.distance_m < 0.04
    assert trial.final.angle_rad < np.radians(1.0)


def test_the_network_on_stacked_images_ends_at_the_goal_from_near(room):
    """Its authors' setting: a start on the way to the goal."""
    network = METHODS["saxena"].load(str(ASSETS / "saxena"))
    trial = servo(room, "saxena", task(0.4, 5), 60, pose=network.pose)
    assert trial.steps[0].distance_m > 0.3
    assert trial.final.distance_m < 0.04
    assert trial.final.angle_rad < np.radians(1.0)


def test_the_published_law_nears_the_goal_slowly(room):
    trial = servo(room, "published", task(0.2, 4), 40)
    first, last = trial.steps[0], trial.final
    assert last.distance_m < 0.95 * first.distance_m
    assert last.angle_rad < first.angle_rad
    assert last.error < first.error


@pytest.mark.parametrize("name", [name for name, kind in METHODS.items() if not kind.network])
def test_a_method_takes_images_larger_than_the_matcher_works_at(room, name):
    """Such images are reduced to 320 x 240 px to be matched."""
    trial = servo(room, name, task(0.2, 4, SMALL.scaled(400, 300)), 2)
    assert trial.end == "iterations"
    assert trial.final.error is not None


def test_a_method_that_goes_astray_is_stopped(room):
    class Runaway:
        def decide(self, sight):
            return Decision(make_pose(np.eye(3), np.array([0.0, 0.0, -0.4])), 1.0)

    trial = run_trial(task(0.2, 4), Runaway(), room, 50)
    assert trial.end == "left"
    assert not trial.converged
    assert trial.iterations_to_criterion is None
    assert trial.path_m == pytest.approx(0.4 * trial.iterations)


def test_a_goal_beside_the_view_is_found_by_looking_around(room):
    aside = T_WORLD_GOAL @ make_pose(so3_exp(np.array([0.0, 1.3, 0.0])), np.array([0.2, 0, 0]))
    # In pictures of half the size, the end hangs on the processor's rounding.
    beside = BenchTask("room", Path("room.glb"), aside, T_WORLD_GOAL, LARGE)
    lost = servo(room, "motion-depth", beside, 80)
    assert lost.end == Status.NO_OVERLAP.value
    assert lost.path_m == 0.0
    found = servo(room, "motion-depth-search", beside, 150)
    assert found.end == "done"
    assert found.converged


def test_a_goal_that_is_nowhere_is_given_up(room):
    away = T_WORLD_GOAL @ make_pose(so3_exp(np.array([0.0, 3.1, 0.0])), np.zeros(3))
    trial = servo(room, "motion-depth-search", replace(task(0.2, 4), T_world_start=away), 150)
    assert trial.end == "the goal is not seen in any direction"
    assert trial.path_m < 1e-6
