"""Pairs of views drawn in the built-in room."""

import numpy as np
import pytest
from built_in_room import built_in_room
from tiny_scenes import scene_of, wall
from view_warping import warp_to_a

from dfvs_core.geometry.poses import invert_pose, so3_log
from dfvs_models.evaluation import LEVELS
from dfvs_models.evaluation_file import EVALUATION_CAMERA, read_flow_pairs
from dfvs_rooms.pairs.evaluation import PairSampler, ViewPair, evaluation_arrays, write_arrays
from dfvs_sim.render.renderer import Renderer
from dfvs_sim.render.truth import exact_flow, visibility
from dfvs_sim.scene.frames import ned_pose_from_gltf
from dfvs_sim.scene.mesh import SceneError
from dfvs_sim.viewpoints.free_space import FreeSpace

_TELLING_PX = 0.5
"""Motion under this is lost in the sampling of fine texture, whatever its sign."""
LIMITS = {"small": (0.15, 6.0), "medium": (0.5, 15.0), "large": (1.2, 30.0)}


@pytest.fixture(scope="module")
def renderer():
    return built_in_room()


@pytest.fixture(scope="module")
def sampler(renderer):
    return PairSampler(renderer)


@pytest.fixture(scope="module")
def evaluation(sampler):
    rng = np.random.default_rng(4)
    return [sampler.evaluation_pair(level, rng) for level in (*LEVELS, *LEVELS)]


def backwards(pair):
    """The same pair with its flow and what is seen from b to a."""
    poses, views = pair.poses[::-1], pair.views[::-1]
    depths = tuple(view.depth_m for view in views)
    flow = exact_flow(EVALUATION_CAMERA, poses[0], depths[0], poses[1])
    return ViewPair(poses, views, flow, visibility(EVALUATION_CAMERA, poses, depths))


def median_flow_px(pair):
    return np.median(np.linalg.norm(pair.flow[pair.visible], axis=-1))


def photometric_error(pair, sign=1.0):
    """Mean difference, of 255, of view a and view b warped to it, where both see."""
    warped = warp_to_a(pair.views[1].image, sign * pair.flow)
    return np.abs(warped.astype(int) - pair.views[0].image)[pair.visible].mean()


class TestAPair:
    def test_is_warped_onto_itself_by_its_flow_both_ways(self, evaluation):
        cases = [*evaluation, *map(backwards, evaluation)]
        errors = np.array([photometric_error(pair) for pair in cases])
        wrong = np.array([photometric_error(pair, sign=-1.0) for pair in cases])
        # fine texture at another scale and outlines are left
        assert errors.mean() < 5.0
        assert wrong.mean() > 4.0 * errors.mean()
        moved = np.array([median_flow_px(pair) for pair in cases]) > _TELLING_PX
        assert moved.sum() >= len(cases) - 4
        assert (errors < wrong)[moved].all()

    def test_returns_where_it_came_from(self, evaluation):
        for pair in evaluation:
            u, v = (EVALUATION_CAMERA.grid() + pair.flow).transpose(2, 0, 1)
            i, j = (np.floor(x[pair.visible]).astype(int) for x in (u, v))
            back = pair.flow[pair.visible] + backwards(pair).flow[j, i]
            assert np.nanmedian(np.linalg.norm(back, axis=-1)) < 1.0

    def test_is_decided_by_its_generator(self, sampler, evaluation):
        again = sampler.evaluation_pair(LEVELS[0], np.random.default_rng(4))
        np.testing.assert_array_equal(again.views[1].image, evaluation[0].views[1].image)
        np.testing.assert_array_equal(again.poses, evaluation[0].poses)

    def test_keeps_both_cameras_away_from_things(self, renderer, evaluation):
        space = FreeSpace(renderer)
        for pair in evaluation:
            assert space.clearance_m(pair.poses[0][:3, 3]) >= 0.3
            assert space.clearance_m(pair.poses[1][:3, 3]) >= 0.25

    def test_for_evaluation_keeps_to_its_level(self, evaluation):
        for level, pair in zip((*LEVELS, *LEVELS), evaluation, strict=True):
            move = invert_pose(pair.poses[0]) @ pair.poses[1]
            most_m, most_deg = LIMITS[level]
            assert 0.4 * most_m <= np.linalg.norm(move[:3, 3]) <= most_m
            assert np.degrees(np.abs(so3_log(move[:3, :3]))).max() <= most_deg + 1e-6
            assert pair.visible.mean() >= 0.2
            right = pair.poses[0][:3, 0]
            assert right[2] == pytest.approx(0.0, abs=1e-9)  # the first view is upright

    def test_is_seen_by_the_camera_of_evaluations(self, renderer, evaluation):
        for view, pose in zip(evaluation[0].views, evaluation[0].poses, strict=True):
            expected = renderer.render(EVALUATION_CAMERA, pose, antialias=True)
            np.testing.assert_array_equal(view.image, expected.image)
            np.testing.assert_array_equal(view.depth_m, expected.depth_m)

    def test_needs_a_scene_that_is_large_enough(self):
        floor = wall(0.0, 0.1, 0.1)[..., [1, 2, 0]]
        with pytest.raises(SceneError, match="room for a camera"):
            PairSampler(Renderer(scene_of(floor)))


def test_an_evaluation_file_is_read_back_as_it_was(evaluation, tmp_path):
    path = tmp_path / "room.npz"
    write_arrays(path, evaluation_arrays(evaluation, (*LEVELS, *LEVELS)))
    pairs = read_flow_pairs(path)
    np.testing.assert_array_equal(pairs.level, [0, 1, 2, 0, 1, 2])
    for k, pair in enumerate(evaluation):
        np.testing.assert_array_equal(pairs.current[k], pair.views[0].image)
        np.testing.assert_array_equal(pairs.other[k], pair.views[1].image)
        seen = pair.visible
        np.testing.assert_array_equal(pairs.visible[k], seen)
        np.testing.assert_allclose(pairs.flow[k][seen], pair.flow[seen], rtol=1e-3, atol=1e-3)
    with np.load(path) as arrays:
        pose = ned_pose_from_gltf(arrays["TB"][2])
        np.testing.assert_allclose(pose, evaluation[2].poses[1], atol=1e-12)
    assert [p.name for p in tmp_path.iterdir()] == ["room.npz"]
