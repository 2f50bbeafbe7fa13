import numpy as np
from tiny_scenes import CAMERA, NORTHWARD, scene_of, wall

from dfvs_core.geometry.poses import make_pose, so3_exp
from dfvs_sim.render.renderer import Renderer
from dfvs_sim.render.truth import exact_flow, visibility
from dfvs_sim.viewpoints.poses import camera_pose

TWO_WALLS = np.concatenate([wall(2.0, 0.4, 0.4), wall(5.0)])


def depths(corners, *poses):
    renderer = Renderer(scene_of(corners))
    return [renderer.depth(CAMERA, pose) for pose in poses]


class TestFlow:
    def test_past_a_wall_is_the_focal_length_times_motion_over_depth(self):
        moved = camera_pose((0.0, 0.3, -0.1), 0.0)
        flow = exact_flow(CAMERA, NORTHWARD, depths(wall(3.0), NORTHWARD)[0], moved)
        np.testing.assert_allclose(flow[..., 0], -CAMERA.fx * 0.3 / 3.0, rtol=1e-4)
        np.testing.assert_allclose(flow[..., 1], CAMERA.fy * 0.1 / 3.0, rtol=1e-4)

    def test_of_a_pure_rotation_does_not_depend_on_depth(self):
        turned = NORTHWARD @ make_pose(so3_exp(np.array([0.02, -0.05, 0.1])), np.zeros(3))
        near, far = (
            exact_flow(CAMERA, NORTHWARD, np.full((60, 80), z, np.float32), turned)
            for z in (1.0, 9.0)
        )
        np.testing.assert_allclose(near, far, atol=1e-4)

    def test_is_not_a_number_for_sky_and_for_points_behind_the_second_camera(self):
        depth = np.full((60, 80), 2.0, np.float32)
        depth[:10] = 0.0
        flow = exact_flow(CAMERA, NORTHWARD, depth, camera_pose((3.0, 0.0, 0.0), 0.0))
        assert np.isnan(flow).all()
        flow = exact_flow(CAMERA, NORTHWARD, depth, NORTHWARD)
        assert np.isnan(flow[:10]).all()
        np.testing.assert_allclose(flow[10:], 0, atol=1e-5)


class TestVisibility:
    def test_leaves_out_what_something_nearer_hides(self):
        beside = camera_pose((0.0, 0.6, 0.0), 0.0)
        first, second = depths(TWO_WALLS, NORTHWARD, beside)
        seen = visibility(CAMERA, (NORTHWARD, beside), (first, second))
        flow = exact_flow(CAMERA, NORTHWARD, first, beside)
        target = CAMERA.grid() + flow
        inside = (target >= 0).all(-1) & (target < CAMERA.size).all(-1)
        # in b the small wall covers |east| < 0.4 seen from 0.6: between 0.2/2 and 1.0/2 left of b
        slope = (target[..., 0] - CAMERA.cx) / CAMERA.fx
        height = (target[..., 1] - CAMERA.cy) / CAMERA.fy
        hidden = (first > 4) & (slope > -0.5) & (slope < -0.1) & (np.abs(height) < 0.2)
        edge = 1.5 / CAMERA.fx  # the four neighbours forgive a pixel around an outline
        sure = (slope > -0.5 + edge) & (slope < -0.1 - edge) & (np.abs(height) < 0.2 - edge)
        assert not seen[hidden & sure].any()
        assert (hidden & sure).sum() > 50
        assert seen[inside & (first < 3)].all()

    def test_leaves_out_what_is_outside_the_other_picture(self):
        turned = camera_pose((0.0, 0.0, 0.0), np.radians(60.0))
        first, second = depths(TWO_WALLS, NORTHWARD, turned)
        seen = visibility(CAMERA, (NORTHWARD, turned), (first, second))
        assert seen.any()
        assert not seen[:, :30].any()

    def test_holds_all_over_a_floor_that_is_seen_aslant(self):
        floor = wall(0.4)[..., [1, 2, 0]]  # 0.4 m below the camera
        ahead = camera_pose((0.05, 0.02, 0.0), 0.1)
        first, second = depths(floor, NORTHWARD, ahead)
        seen = visibility(CAMERA, (NORTHWARD, ahead), (first, second))
        target = CAMERA.grid() + exact_flow(CAMERA, NORTHWARD, first, ahead)
        # where all four neighbours show the floor and the horizon is some pixels away
        low, high = np.array([1.0, 34.0]), np.array(CAMERA.size) - 1.0
        inside = (first > 0) & (target > low).all(-1) & (target < high).all(-1)
        assert inside.sum() > 1000
        assert seen[inside].all()

    def test_between_equal_views_leaves_out_the_sky_alone(self):
        (depth,) = depths(wall(2.0, 0.4, 0.4), NORTHWARD)
        seen = visibility(CAMERA, (NORTHWARD, NORTHWARD), (depth, depth))
        np.testing.assert_array_equal(seen, depth > 0)
