import hashlib
import os
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from tiny_scenes import CAMERA, NORTHWARD, SKY, random_triangles, scene_of, wall

import dfvs_sim
from dfvs_core.errors import GeometryError
from dfvs_core.geometry.camera import CameraModel
from dfvs_sim.render.renderer import NEAR_M, Renderer
from dfvs_sim.scene.texture import srgb_from_linear
from dfvs_sim.viewpoints.poses import camera_pose

RED, GREEN = np.array([1.0, 0.0, 0.0]), np.array([0.0, 1.0, 0.0])


def seen(corners, colours=None, camera=CAMERA, pose=NORTHWARD):
    return Renderer(scene_of(corners, colours)).render(camera, pose)


class TestDepth:
    def test_of_a_wall_straight_ahead_is_its_distance(self):
        depth = seen(wall(3.0)).depth_m
        np.testing.assert_allclose(depth, 3.0, rtol=1e-6)

    def test_of_a_floor_that_runs_under_and_behind_the_camera_is_right_everywhere(self):
        floor = np.array([[(-90, -90, 1.5), (90, -90, 1.5), (0, 300, 1.5)]], dtype=float)
        depth = seen(floor).depth_m
        v = CAMERA.grid()[..., 1] - CAMERA.cy
        expected = 1.5 * CAMERA.fy / np.where(v > 0, v, np.inf)
        inside = depth > 0
        assert inside[v > 8].mean() > 0.95
        assert not inside[v < 0].any()
        np.testing.assert_allclose(depth[inside], expected[inside], rtol=1e-5)

    def test_of_a_floor_ends_at_its_far_edge(self):
        a, b, c, d = (-50, -90, 1.5), (-50, 90, 1.5), (10, 90, 1.5), (10, -90, 1.5)
        depth = seen(np.array([(a, b, c), (c, d, a)], dtype=float)).depth_m
        rows = CAMERA.grid()[:, 0, 1] - CAMERA.cy
        below = rows > 1.5 * CAMERA.fy / 10.0
        np.testing.assert_array_equal((depth > 0).any(axis=1), below)

    def test_is_never_less_than_the_near_plane(self):
        floor = np.array([[(-90, -90, 0.005), (90, -90, 0.005), (0, 300, 0.005)]], dtype=float)
        depth = seen(floor).depth_m
        assert (depth > 0).any()
        assert depth[depth > 0].min() >= NEAR_M

    def test_is_zero_where_nothing_is(self):
        view = seen(wall(3.0, 0.5, 0.5))
        sky = view.depth_m == 0
        assert 0.2 < sky.mean() < 0.99
        code = np.rint(255 * srgb_from_linear(np.array(SKY, np.float32)))
        assert np.abs(view.image[sky] - code).max() <= 1

    def test_is_the_same_without_the_picture(self, rng):
        renderer = Renderer(scene_of(random_triangles(rng, 50)))
        alone = renderer.depth(CAMERA, NORTHWARD)
        np.testing.assert_array_equal(alone, renderer.render(CAMERA, NORTHWARD).depth_m)


class TestTheNearestSurface:
    @pytest.mark.parametrize("order", [slice(None), slice(None, None, -1)])
    def test_hides_what_is_behind_it_in_any_order(self, order):
        corners = np.concatenate([wall(2.0, 0.5, 0.5), wall(5.0)])[order]
        colours = np.repeat([RED, RED, GREEN, GREEN], 3, axis=0).reshape(4, 3, 3)[order]
        view = seen(corners, colours)
        near = view.depth_m < 3.0
        assert (view.image[near] == (255, 0, 0)).all()
        assert (view.image[~near] == (0, 255, 0)).all()
        assert near[30, 40]
        assert not near[0, 0]

    def test_is_seen_from_both_sides(self):
        behind = camera_pose((6.0, 0.0, 0.0), np.pi)
        assert (seen(wall(3.0), pose=behind).depth_m == 3.0).all()

    def test_ends_at_the_near_plane(self):
        assert (seen(wall(0.5 * NEAR_M)).depth_m == 0).all()
        assert (seen(wall(2.0 * NEAR_M)).depth_m > 0).all()

    def test_does_not_include_what_is_behind_the_camera(self):
        assert (seen(wall(-2.0)).depth_m == 0).all()


class TestCoverage:
    def test_goes_by_pixel_centres(self):
        # at 2 m, 0.5 m to each side of the axis: columns whose centre is within f / 4 of cx
        half = 0.25 * CAMERA.fx
        columns = (seen(wall(2.0, 0.5, 0.5)).depth_m > 0).any(axis=0)
        expected = np.abs(np.arange(CAMERA.width) + 0.5 - CAMERA.cx) <= half
        np.testing.assert_array_equal(columns, expected)

    def test_has_no_gap_between_triangles_that_share_an_edge(self, rng):
        n = 24
        north = 3.0 + 0.3 * rng.normal(size=(n, n))
        y, z = np.meshgrid(np.linspace(-6, 6, n), np.linspace(-5, 5, n))
        points = np.stack([north, y + 0.1 * rng.normal(size=(n, n)), z], axis=-1)
        a, b, c, d = points[:-1, :-1], points[:-1, 1:], points[1:, 1:], points[1:, :-1]
        corners = np.concatenate([np.stack(t, 2).reshape(-1, 3, 3) for t in ((a, b, c), (c, d, a))])
        camera = CameraModel.from_horizontal_fov(640, 480, np.radians(75.0))
        assert (seen(corners, camera=camera).depth_m > 0).all()

    def test_has_no_gap_where_an_edge_runs_through_pixel_centres(self):
        camera = CameraModel(64, 64, 64.0, 64.0, 32.5, 32.5)  # the axis meets a pixel's centre
        a, b, c, d, o = (2, -3, -3), (2, 3, -3), (2, 3, 3), (2, -3, 3), (2, 0, 0)
        corners = np.array([(a, b, o), (b, c, o), (c, d, o), (d, a, o)], dtype=float)
        assert (seen(corners, camera=camera).depth_m > 0).all()


class TestTrianglesThatAreNone:
    def test_draw_nothing(self):
        line = np.array([[(2, -1, 0), (2, 0, 0), (2, 1, 0)]], dtype=float)
        point = np.array([[(2, 0.1, 0.1)] * 3], dtype=float)
        edge_on = np.array([[(1, 0, 0), (2, 0, 0), (3, 0, 0)]], dtype=float)
        through_eye = np.array([[(0, 0, 0), (2, 1, 0), (2, -1, 0)]], dtype=float)
        for corners in (line, point, edge_on, through_eye):
            # an edge-on surface has no area in the picture, but may touch a row of pixels
            assert (seen(corners).depth_m > 0).mean() <= 1 / CAMERA.height

    @pytest.mark.parametrize("size_m", [1e-12, 1e12, 3e37])
    def test_of_any_size_do_no_harm(self, rng, size_m):
        corners = random_triangles(rng, 200, spread_m=size_m, size_m=size_m)
        view = seen(np.concatenate([corners, wall(3.0)]))
        assert np.isfinite(view.depth_m).all()
        assert (view.depth_m > 0).all()


def test_refuses_a_pose_that_is_none():
    renderer = Renderer(scene_of(wall(3.0)))
    with pytest.raises(GeometryError, match="orthonormal"):
        renderer.render(CAMERA, 2.0 * np.eye(4))


@pytest.fixture
def compiled(pytestconfig, tmp_path):
    """Folder for compiled kernels; it stays for later runs of the same sources."""
    sources = sorted(Path(dfvs_sim.__file__).parent.rglob("*.py"))
    digest = hashlib.sha256(b"".join(path.read_bytes() for path in sources)).hexdigest()
    if not pytestconfig.pluginmanager.hasplugin("cacheprovider"):
        return tmp_path
    caches = pytestconfig.rootpath / pytestconfig.getini("cache_dir")
    folder = caches / f"bounds-{digest[:16]}"  # beside what --cache-clear removes
    folder.mkdir(parents=True, exist_ok=True)
    for old in set(folder.parent.glob("bounds-*")) - {folder}:
        shutil.rmtree(old)
    return folder


@pytest.mark.slow
def test_never_reads_or_writes_outside_its_arrays(compiled):
    """The kernels again, compiled with bounds checks: out of range raises instead of crashing."""
    program = """
import numpy as np
from tiny_scenes import *
from dfvs_sim.render.renderer import Renderer
rng = np.random.default_rng(3)
uv = rng.uniform(-9, 9, (300, 3, 2))
for size_m in (1e-9, 0.5, 4.0, 1e9):
    corners = np.concatenate([random_triangles(rng, 298, 3.0, size_m), wall(6.0)])
    renderer = Renderer(scene_of(corners, uv=uv, texture=checkerboard(8)))
    for yaw in (0.0, 1.0, 2.0):
        for antialias in (False, True):
            view = renderer.render(CAMERA, camera_pose((0.1, 0.0, 0.0), yaw), antialias)
            assert np.isfinite(view.depth_m).all()
try:
    from dfvs_sim.render.geometry import transform_vertices
    transform_vertices(np.zeros((2, 3), np.float32), np.eye(3, 4), np.zeros((1, 3)))
except IndexError:
    print("checked")
"""
    environment = os.environ | {
        "NUMBA_BOUNDSCHECK": "1",
        "NUMBA_CACHE_DIR": str(compiled),
        "PYTHONPATH": os.pathsep.join(sys.path),
    }
    done = subprocess.run(
        [sys.executable, "-c", program],
        env=environment,
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    assert done.stdout.strip() == "checked"
