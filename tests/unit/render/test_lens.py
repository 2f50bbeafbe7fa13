import numpy as np
import pytest
from tiny_scenes import CAMERA, NORTHWARD, WALL_UV, checkerboard, scene_of, wall

from dfvs_core.errors import GeometryError
from dfvs_core.geometry.camera import CameraModel
from dfvs_sim.render.lens import lens_of
from dfvs_sim.render.renderer import Renderer
from dfvs_sim.viewpoints.poses import camera_pose

BARREL = (-0.25, 0.08, 0.002, -0.001)


def distorted(coefficients=BARREL, width=320, height=240):
    f = 0.65 * width
    return CameraModel(width, height, f, f, 0.5 * width, 0.5 * height, coefficients)


class TestADistortedCamera:
    def test_sees_the_depth_of_a_slanted_wall_exactly_in_each_pixel_ray(self):
        pose = camera_pose((0.0, 0.0, 0.0), 0.4)
        camera = distorted()
        depth = Renderer(scene_of(wall(3.0))).render(camera, pose).depth_m
        x, y = np.moveaxis(camera.normalise(camera.grid()), -1, 0)
        rays = np.stack([x, y, np.ones_like(x)], -1) @ pose[:3, :3].T
        # the ray north x t = 3; single precision of the lens table is worth 1e-5
        np.testing.assert_allclose(depth, 3.0 / rays[..., 0], rtol=5e-5)

    def test_sees_points_where_its_model_projects_them(self):
        camera = distorted()
        scene = scene_of(wall(2.0, 1.0, 1.0), uv=WALL_UV, texture=checkerboard(4, 256))
        image = Renderer(scene).render(camera, NORTHWARD, antialias=True).image[..., 0] > 127
        grid = np.linspace(-0.9, 0.9, 25)
        x, y = np.meshgrid(grid, grid)
        inside = (np.abs(x * 2 % 1 - 0.5) < 0.4) & (np.abs(y * 2 % 1 - 0.5) < 0.4)
        points = np.stack([x, y, np.full_like(x, 2.0)], -1)[inside]
        white = (np.floor(2 * points[:, 0]) + np.floor(2 * points[:, 1])).astype(int) % 2 == 1
        u, v = camera.project(points).T
        within = (u > 0) & (u < camera.width) & (v > 0) & (v < camera.height)
        got = image[v[within].astype(int), u[within].astype(int)]
        assert within.sum() > 100
        np.testing.assert_array_equal(got, white[within])

    def test_agrees_with_the_pinhole_where_the_distortion_is_nothing(self):
        tiny = distorted((1e-9, 0.0, 0.0, 0.0))
        plain = CameraModel(tiny.width, tiny.height, tiny.fx, tiny.fy, tiny.cx, tiny.cy)
        renderer = Renderer(scene_of(wall(2.0, 0.7, 0.4)))
        first, second = (renderer.render(c, NORTHWARD) for c in (tiny, plain))
        np.testing.assert_allclose(first.depth_m, second.depth_m, rtol=1e-5)
        np.testing.assert_allclose(renderer.depth(tiny, NORTHWARD), second.depth_m, rtol=1e-5)
        assert np.abs(first.image.astype(int) - second.image).max() <= 1

    def test_that_sees_nothing_has_no_depth(self):
        assert (Renderer(scene_of(wall(-2.0))).render(distorted(), NORTHWARD).depth_m == 0).all()

    def test_that_opencv_does_not_invert_is_refused(self):
        wide = CameraModel(640, 480, 211.0, 211.0, 320.0, 240.0, (0.7, 0.05, 0.0, 0.0, -0.17))
        with pytest.raises(GeometryError, match="cannot be inverted"):
            lens_of(wide)

    def test_that_sees_too_wide_is_refused(self):
        wide = CameraModel(320, 240, 50.0, 50.0, 160.0, 120.0, (0.001, 0.0, 0.0, 0.0))
        with pytest.raises(GeometryError, match="70 degrees"):
            Renderer(scene_of(wall(2.0))).render(wide, NORTHWARD)


def test_a_pinhole_of_any_width_is_drawn():
    camera = CameraModel.from_horizontal_fov(80, 60, np.radians(150.0))
    assert CAMERA.distortion == ()
    assert (Renderer(scene_of(wall(2.0))).depth(camera, NORTHWARD) > 0).all()
