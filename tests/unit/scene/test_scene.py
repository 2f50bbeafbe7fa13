from dataclasses import replace

import numpy as np
import pytest
from tiny_scenes import scene_of, wall

from dfvs_core.errors import GeometryError
from dfvs_core.geometry.poses import invert_pose, pose_error
from dfvs_sim.scene.frames import (
    gltf_from_ned,
    gltf_pose_from_ned,
    ned_from_gltf,
    ned_pose_from_gltf,
)
from dfvs_sim.scene.mesh import SceneError
from dfvs_sim.viewpoints.poses import camera_pose, look_at
from dfvs_sim.viewpoints.sampling import floor_of

WALL = scene_of(wall(2.0))


class TestAScene:
    @pytest.mark.parametrize(
        ("wrong", "match"),
        [
            ({"triangles": WALL.triangles + 1}, "expected 0 to 5"),
            ({"texture_index": WALL.texture_index + 1}, "texture indices"),
            ({"vertices": WALL.vertices.astype(float)}, "float64"),
        ],
        ids=["vertices that are not there", "textures that are not there", "another type"],
    )
    def test_refuses_arrays_that_do_not_fit_together(self, wrong, match):
        with pytest.raises(SceneError, match=match):
            replace(WALL, **wrong)

    def test_is_bounded_by_the_vertices_in_use(self):
        low, high = scene_of(wall(2.0, 1.0, 3.0)).bounds
        np.testing.assert_allclose([low, high], [(2, -1, -3), (2, 1, 3)])

    def test_has_its_floor_below_tables_and_ceiling(self):
        def level(down_m, half):
            corners = wall(0.0, half, half)[..., [1, 2, 0]]
            return corners + np.array([0.0, 0.0, down_m])

        scene = scene_of(np.concatenate([level(-2.8, 3.0), level(-0.7, 0.6), level(0.1, 3.0)]))
        floor_m, low, high = floor_of(scene)
        assert floor_m == pytest.approx(0.1)
        np.testing.assert_allclose([low, high], [(-3, -3), (3, 3)])

    def test_without_anything_level_has_no_floor(self):
        with pytest.raises(SceneError, match="no level surface"):
            floor_of(WALL)


class TestTheTwoFrames:
    def test_are_inverse_to_each_other(self, rng):
        points = rng.normal(size=(5, 4, 3))
        np.testing.assert_allclose(gltf_from_ned(ned_from_gltf(points)), points)
        pose = camera_pose((1.0, 2.0, 3.0), 0.4, -0.2)
        np.testing.assert_allclose(ned_pose_from_gltf(gltf_pose_from_ned(pose)), pose, atol=1e-12)

    def test_agree_on_where_up_is(self):
        np.testing.assert_allclose(ned_from_gltf(np.array([0.0, 1.0, 0.0])), [0, 0, -1])


class TestCameraPoses:
    @pytest.mark.parametrize(
        ("yaw_deg", "ahead"), [(0, (1, 0, 0)), (90, (0, 1, 0)), (180, (-1, 0, 0))]
    )
    def test_look_along_their_yaw_with_the_picture_upright(self, yaw_deg, ahead):
        pose = camera_pose((1.0, 2.0, -1.5), np.radians(yaw_deg))
        np.testing.assert_allclose(pose[:3, 2], ahead, atol=1e-12)
        np.testing.assert_allclose(pose[:3, 1], (0, 0, 1), atol=1e-12)
        np.testing.assert_allclose(pose[:3, 3], (1.0, 2.0, -1.5))

    def test_look_up_with_positive_pitch(self):
        assert camera_pose((0, 0, 0), 0.0, 0.3)[2, 2] < 0

    def test_looking_at_a_point_puts_it_on_the_optical_axis(self, rng):
        eye, target = rng.normal(size=3), rng.normal(size=3)
        pose = look_at(eye, target)
        x, y, z = (invert_pose(pose) @ [*ned_from_gltf(target), 1.0])[:3]
        assert z == pytest.approx(np.linalg.norm(target - eye))
        np.testing.assert_allclose([x, y], 0.0, atol=1e-12)
        assert pose[2, 0] == pytest.approx(0.0)  # the picture's x axis is level
        assert pose[2, 1] > 0  # and its y axis points down

    def test_looking_north_both_ways_is_the_same(self):
        by_points = look_at((2.0, 1.5, -1.0), (2.0, 1.5, -9.0))
        by_yaw = camera_pose((1.0, 2.0, -1.5), 0.0)
        assert pose_error(by_points, by_yaw) == pytest.approx((0.0, 0.0), abs=1e-9)

    def test_straight_down_has_no_upright_picture(self):
        with pytest.raises(GeometryError, match="straight above"):
            look_at((0.0, 2.0, 0.0), (0.0, 0.0, 0.0))
