"""The law closed over noise-free flow, as tabulated in docs/experiments/benchmark.md."""

from dataclasses import dataclass

import numpy as np
import pytest

from dfvs_core.geometry.camera import CameraModel
from dfvs_core.geometry.poses import invert_pose, make_pose, so3_exp, so3_log
from dfvs_core.messages.goal import GoalSidecar, Mount
from dfvs_core.servo.config import ServoConfig
from dfvs_core.servo.motion import find_goal, wanted_motion
from dfvs_core.servo.points import ServoPoints
from dfvs_core.servo.task import ServoTask

CAMERA = CameraModel.from_horizontal_fov(512, 384, np.radians(90))
GAIN = 0.1
NEAREST_M = 0.5
SEEDS = range(12)


@dataclass(frozen=True)
class Run:
    iterations: int | None
    path_ratio: float


def servo(seed, task, T_goal_current, iterations=400, constant_z=None):
    """Iterate the law at gain 0.1 until the paper's criterion, 4 cm and 1 degree."""
    rng = np.random.default_rng(seed)
    z = rng.uniform(2.0, 6.0, 400)
    xy_goal = rng.uniform(-1.0, 1.0, (400, 2)) * [1.0, 0.75]
    P_goal = np.column_stack([xy_goal * z[:, None], z])
    T, path, start = T_goal_current, 0.0, np.linalg.norm(T_goal_current[:3, 3])
    for k in range(iterations):
        if np.linalg.norm(T[:3, 3]) < 0.04 and np.linalg.norm(so3_log(T[:3, :3])) < np.radians(1):
            return Run(k, path / start)
        to_current = invert_pose(T)
        Q = P_goal @ to_current[:3, :3].T + to_current[:3, 3]
        seen = Q[:, 2] > NEAREST_M
        depth = Q[seen, 2]
        points = ServoPoints(
            Q[seen, :2] / depth[:, None],
            xy_goal[seen],
            depth if constant_z is None else np.full(len(depth), constant_z),
            np.ones(len(depth)),
            np.zeros(len(depth)),
        )
        pose = find_goal(task, points, None)
        motion, _ = wanted_motion(task, points, pose)
        T_next = T @ task.basis.exp(GAIN * motion)
        path += np.linalg.norm(T_next[:3, 3] - T[:3, 3])
        T = T_next
    return Run(None, path / start)


def free_start(seed, distance_m, angle_deg):
    rng = np.random.default_rng(1000 + seed)
    direction, axis = rng.normal(size=(2, 3))
    direction, axis = direction / np.linalg.norm(direction), axis / np.linalg.norm(axis)
    return make_pose(so3_exp(axis * np.radians(angle_deg)), direction * distance_m)


def task(law, mount=None):
    config = ServoConfig(law=law, damping=0.0)
    return ServoTask(config, CAMERA, GoalSidecar(CAMERA), mount)


# The bar is 42 and 56 iterations for the corrected law, 35 and 43 for the mean Jacobian. Points
# that the path leads close by dominate the image-based laws, which is why "current" takes longer
# from 3 m here; the default, "hybrid", does not suffer from them.
@pytest.mark.parametrize(
    ("law", "distance_m", "angle_deg", "most_iterations", "most_path"),
    [
        ("current", 1.5, 15, 42, 1.10),
        ("mean", 1.5, 15, 36, 1.05),
        ("pose", 1.5, 15, 36, 1.05),
        ("hybrid", 1.5, 15, 36, 1.05),
        ("current", 3.0, 40, 80, 1.50),
        ("mean", 3.0, 40, 56, 1.35),
        ("pose", 3.0, 40, 43, 1.05),
        ("hybrid", 3.0, 40, 43, 1.05),
    ],
)
def test_all_twelve_seeds_converge_in_few_iterations(
    law, distance_m, angle_deg, most_iterations, most_path
):
    starts = [free_start(seed, distance_m, angle_deg) for seed in SEEDS]
    runs = [servo(seed, task(law), T) for seed, T in zip(SEEDS, starts, strict=True)]
    assert all(run.iterations is not None for run in runs)
    assert np.median([run.iterations for run in runs]) <= most_iterations
    assert np.mean([run.path_ratio for run in runs]) <= most_path


def test_a_constant_depth_is_a_sound_last_resort():
    runs = [servo(seed, task("mean"), free_start(seed, 3.0, 40), constant_z=3.0) for seed in SEEDS]
    assert all(run.iterations is not None for run in runs)
    assert np.median([run.iterations for run in runs]) <= 74


@pytest.mark.parametrize(
    ("law", "most_iterations"), [("current", 90), ("mean", 56), ("hybrid", 46)]
)
@pytest.mark.parametrize(
    "mount", [Mount(), Mount(x_m=0.1, z_m=0.03, pitch_rad=-0.5)], ids=["level", "tilted"]
)
def test_four_degrees_of_freedom_converge_as_well(law, most_iterations, mount):
    flight = task(law, mount)
    runs = []
    for seed in SEEDS:
        rng = np.random.default_rng(2000 + seed)
        direction = rng.normal(size=3) * [1.0, 1.0, 0.3]
        direction *= 2.5 / np.linalg.norm(direction)
        u = np.append(direction, rng.choice([-1, 1]) * np.radians(30))
        runs.append(servo(seed, flight, flight.basis.exp(u)))
    assert all(run.iterations is not None for run in runs)
    assert np.median([run.iterations for run in runs]) <= most_iterations
