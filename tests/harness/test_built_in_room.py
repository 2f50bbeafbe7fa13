"""The room that comes with the package, seen through the renderer as a flight sees it."""

import hashlib
import json
from concurrent.futures import ThreadPoolExecutor

import cv2
import numpy as np
import pytest
from built_in_room import built_in_room
from view_warping import warp_to_a

from dfvs_core.geometry.camera import CameraModel
from dfvs_core.geometry.poses import invert_pose, pose_error
from dfvs_sim.render.truth import exact_flow, visibility
from dfvs_sim.scene import builtin_room_path
from dfvs_sim.scene.mesh import SceneError
from dfvs_sim.viewpoints.poses import camera_pose, look_at
from dfvs_sim.viewpoints.sampling import TaskLimits, sample_task

CAMERA = CameraModel.from_horizontal_fov(320, 240, np.radians(75.0))
SEEDS = range(6)


@pytest.fixture(scope="module")
def room():
    return built_in_room()


@pytest.fixture(scope="module")
def tasks(room):
    return [sample_task(room, CAMERA, np.random.default_rng(seed)) for seed in SEEDS]


@pytest.fixture(scope="module")
def poses(room):
    """Level views from the free middle of the room, in all directions."""
    rng = np.random.default_rng(4)
    return [
        camera_pose((rng.uniform(-1.6, 1.6), rng.uniform(-1.0, 1.9), rng.uniform(-1.7, -0.9)), yaw)
        for yaw in np.arange(24) * np.pi / 12
    ]


class TestPictures:
    def test_warped_by_the_exact_flow_fit_each_other(self, room, tasks):
        camera = CAMERA.scaled(640, 480)
        errors = []
        for task in tasks:
            a, b = task.T_world_goal, task.T_world_start
            first, second = room.render(camera, a), room.render(camera, b)
            flow = exact_flow(camera, a, first.depth_m, b)
            seen = visibility(camera, (a, b), (first.depth_m, second.depth_m))
            warped = warp_to_a(second.image, flow).astype(float)
            errors.append(np.abs(warped - first.image)[seen].mean())
        # what remains is sampling: fine texture seen at another scale, and outlines; a flow
        # that is off by half a pixel costs twice as much
        assert np.mean(errors) < 3.0
        assert max(errors) < 5.0

    def test_do_not_depend_on_what_was_drawn_before_or_on_the_thread(self, room, poses):
        def digest(pose):
            view = room.render(CAMERA, pose)
            return hashlib.sha256(view.image.tobytes() + view.depth_m.tobytes()).hexdigest()

        forwards = [digest(pose) for pose in poses[:8]]
        with ThreadPoolExecutor(4) as pool:
            together = list(pool.map(digest, poses[7::-1]))
        assert together[::-1] == forwards
        assert len(set(forwards)) == 8

    def test_show_no_gap_in_the_room(self, room, poses):
        for pose in poses:
            assert (room.depth(CAMERA, pose) > 0).all()

    def test_hold_features_in_every_direction(self, room, poses):
        sift = cv2.SIFT.create()
        counts = [
            len(sift.detect(cv2.cvtColor(room.render(CAMERA, p).image, cv2.COLOR_RGB2GRAY), None))
            for p in poses
        ]
        assert min(counts) > 80, counts

    def test_are_neither_dark_nor_burnt_out(self, room, poses):
        for pose in poses:
            grey = room.render(CAMERA, pose).image.mean(axis=2)
            assert 60 < grey.mean() < 200
            assert (grey > 250).mean() < 0.1
            assert (grey < 5).mean() < 0.05


class TestFlights:
    def test_start_and_end_level_within_the_limits(self, tasks):
        limits = TaskLimits()
        for task in tasks:
            distance_m, angle_rad = pose_error(task.T_world_start, task.T_world_goal)
            # a climb of up to 0.25 m may lengthen the least distance, the most is kept
            assert limits.distance_m[0] - 1e-9 <= distance_m <= limits.distance_m[1] + 1e-9
            assert limits.yaw_rad[0] - 1e-9 <= angle_rad <= limits.yaw_rad[1] + 1e-9
            for pose in (task.T_world_start, task.T_world_goal):
                np.testing.assert_allclose(pose[:3, 1], (0, 0, 1), atol=1e-12)
                assert 0.8 <= -pose[2, 3] <= 1.81  # the floor is 1.5 mm below 0

    def test_overlap_as_they_say(self, room, tasks):
        for task in tasks:
            views = (task.T_world_goal, task.T_world_start)
            depths = tuple(room.depth(CAMERA, pose) for pose in views)
            assert visibility(CAMERA, views, depths).mean() == pytest.approx(task.overlap)
            assert task.overlap >= TaskLimits().overlap

    def test_keep_clear_of_everything_on_the_straight_line(self, room, tasks):
        corners = room.scene.vertices[room.scene.triangles].astype(np.float64)
        samples = np.concatenate([corners.reshape(-1, 3), corners.mean(axis=1)])
        for task in tasks:
            ends = task.T_world_start[:3, 3], task.T_world_goal[:3, 3]
            for share in np.linspace(0.0, 1.0, 15):
                point = (1 - share) * ends[0] + share * ends[1]
                # between the probed points, 0.25 m apart, up to 0.02 m are lost
                assert np.linalg.norm(samples - point, axis=1).min() > 0.37

    def test_come_from_the_seed_alone(self, room, tasks):
        again = sample_task(room, CAMERA, np.random.default_rng(SEEDS[0]))
        np.testing.assert_array_equal(again.T_world_goal, tasks[0].T_world_goal)
        np.testing.assert_array_equal(again.T_world_start, tasks[0].T_world_start)

    def test_that_cannot_be_are_refused_with_a_reason(self, room):
        limits = TaskLimits(clearance_m=5.0)
        with pytest.raises(SceneError, match="no flight of"):
            sample_task(room, CAMERA, np.random.default_rng(0), limits)


def test_the_named_views_lie_in_the_room_and_see_it(room):
    description = json.loads(builtin_room_path().with_suffix(".json").read_text())
    low, high = room.scene.bounds
    assert len(description["views"]) >= 3
    for view in description["views"].values():
        pose = look_at(view["eye_gltf_m"], view["look_at_gltf_m"])
        assert (low < pose[:3, 3]).all()
        assert (pose[:3, 3] < high).all()
        depth = room.depth(CAMERA, pose)
        assert 1.0 < np.median(depth) < 7.0
        ahead = invert_pose(pose) @ np.array([0.0, 0.0, -1.2, 1.0])
        assert ahead[2] > 0  # the middle of the room is in front
