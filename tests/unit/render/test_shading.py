import numpy as np
import pytest
from tiny_scenes import CAMERA, NORTHWARD, WALL_UV, checkerboard, scene_of, wall

from dfvs_core.geometry.camera import CameraModel
from dfvs_sim.render.renderer import Renderer
from dfvs_sim.scene.texture import Texture, Wrap, linear_from_srgb, srgb_from_linear


def code(linear):
    return np.rint(255.0 * srgb_from_linear(np.asarray(linear, np.float32)))


def picture(corners, colours=None, uv=None, texture=None, antialias=False, camera=CAMERA):
    scene = scene_of(corners, colours, uv, texture)
    return Renderer(scene).render(camera, NORTHWARD, antialias).image.astype(int)


class TestVertexColours:
    def test_are_linear_light(self):
        image = picture(wall(3.0), colours=np.array([0.2140, 0.0, 1.0]))
        assert np.abs(image - [128, 0, 255]).max() <= 1

    def test_run_straight_in_space_not_in_the_picture(self):
        # a floor that gets brighter with the distance: light is 0.1 x north
        floor = np.array([[(0.5, -40, 1), (9.5, 0, 1), (0.5, 40, 1)]], dtype=float)
        light = 0.1 * floor[..., :1] * np.ones(3)
        view = Renderer(scene_of(floor, light)).render(CAMERA, NORTHWARD)
        on = view.depth_m > 0
        assert on.sum() > 300
        assert np.abs(view.image[on] - code(0.1 * view.depth_m[on])[:, None]).max() <= 1

    def test_brighter_than_white_are_white(self):
        assert (picture(wall(3.0), colours=np.array([5.0, 2.0, 1.0])) == 255).all()


class TestTextures:
    def test_lie_upright_with_v_downwards(self):
        texels = np.zeros((2, 2, 3), np.uint8)
        texels[0, 1] = (255, 0, 0)
        texels[1, 0] = (0, 0, 255)
        half = 1.0
        image = picture(
            wall(2.0, half, half), uv=WALL_UV, texture=Texture(texels, Wrap.CLAMP, Wrap.CLAMP)
        )
        reach = int(0.4 * CAMERA.fx * half / 2.0)
        assert image[30 - reach, 40 + reach].argmax() == 0  # top right is red
        assert image[30 + reach, 40 - reach].argmax() == 2  # bottom left is blue

    def test_show_a_texel_unmixed_at_its_centre(self, rng):
        # three pixels per texel, every third one's centre on a texel's centre
        camera = CameraModel(96, 96, 96.0, 96.0, 48.0, 48.0)
        texels = rng.integers(0, 256, (32, 32, 3), dtype=np.uint8)
        image = picture(wall(1.0, 0.5, 0.5), uv=WALL_UV, texture=Texture(texels), camera=camera)
        assert np.abs(image[1::3, 1::3] - texels).max() <= 1

    def test_multiply_with_the_vertex_colour(self):
        grey = Texture(np.full((4, 4, 3), 188, np.uint8))
        image = picture(wall(3.0), colours=np.array([0.5, 1.0, 0.25]), uv=WALL_UV, texture=grey)
        expected = code(linear_from_srgb(np.float32(188 / 255)) * np.array([0.5, 1.0, 0.25]))
        assert np.abs(image - expected).max() <= 1

    def test_fade_to_their_mean_light_far_away(self):
        tiled = 400.0 * WALL_UV  # 400 x 8 squares over 50 px: far below a pixel
        image = picture(wall(3.0), uv=tiled, texture=checkerboard(8))
        # the mean of black and white light is code 188, not 128; mip levels round to 1/255
        assert np.abs(image - 188).max() <= 2

    def test_keep_their_stripes_on_a_slanted_floor(self):
        # stripes that run north stay sharp far out, where a square footprint would blur them
        floor = np.array([[(0.5, -60, 1), (60, 0, 1), (0.5, 60, 1)]], dtype=float)
        stripes = np.zeros((64, 64, 3), np.uint8)
        stripes[:, ::4] = stripes[:, 1::4] = 255
        uv = floor[..., [1, 0]] * 0.4
        camera = CameraModel.from_horizontal_fov(320, 240, np.radians(75.0))
        image = picture(floor, uv=uv, texture=Texture(stripes), camera=camera)
        far_row = image[120 + 44, :, 0]  # 4.7 m away: a pixel is 0.6 texels wide and 2.7 long
        assert np.ptp(far_row) > 100

    @pytest.mark.parametrize(
        ("wrap", "expected"),
        [
            (Wrap.REPEAT, [0, 255, 0, 255]),
            (Wrap.CLAMP, [0, 0, 255, 255]),
            (Wrap.MIRROR, [255, 255, 0, 0]),
        ],
    )
    def test_continue_beyond_their_edges_as_told(self, wrap, expected):
        texels = np.zeros((1, 2, 3), np.uint8)
        texels[0, 1] = 255  # black at u = 0.25, white at 0.75
        start = {Wrap.REPEAT: 0.0, Wrap.CLAMP: -0.5, Wrap.MIRROR: 0.5}[wrap]
        uv = WALL_UV * [2.0, 1.0] + [start, 0.0]
        texture = Texture(texels, wrap, Wrap.CLAMP)
        image = picture(wall(2.0, 1.0, 1.0), uv=uv, texture=texture)
        quarters = np.array([0.125, 0.375, 0.625, 0.875])
        columns = (CAMERA.cx + CAMERA.fx * (quarters - 0.5)).astype(int)
        # a column's centre may lie half a pixel, 4 % of a texel, off the texel's centre
        assert np.abs(image[30, columns, 0] - expected).max() < 60

    @pytest.mark.parametrize("width", [3, 4])
    def test_repeat_whatever_their_width(self, width):
        texels = np.linspace(0, 255, width).astype(np.uint8)
        image = np.repeat(np.tile(texels, (2, 1))[..., None], 3, axis=2)
        camera = CameraModel(192, 32, 96.0, 96.0, 96.0, 16.0)
        got = picture(
            wall(1.0, 1.0, 1.0), uv=WALL_UV * [4, 1], texture=Texture(image), camera=camera
        )
        step = 192 // (4 * width)  # px for a texel
        centres = np.arange(4 * width) * step + step // 2
        # a pixel's centre lies up to half a pixel beside the texel's
        assert np.abs(got[16, centres, 0] - np.tile(texels, 4)).max() < 30


class TestAntialiasing:
    def test_mixes_light_at_an_edge_and_nothing_else(self):
        corners = wall(2.0, 0.488, 0.488)
        plain, smooth = (picture(corners, antialias=a) for a in (False, True))
        differs = (plain != smooth).any(axis=2)
        assert differs.any()
        assert differs.mean() < 0.1
        levels = {tuple(v) for v in smooth.reshape(-1, 3)}
        sky = np.array([0.1, 0.2, 0.3])
        allowed = [code(share + (1 - share) * sky) for share in (0, 0.25, 0.5, 0.75, 1.0)]
        assert all(min(np.abs(np.array(v) - a).max() for a in allowed) <= 1 for v in levels)

    def test_leaves_the_depth_alone(self, rng):
        corners = wall(2.0, 0.488, 0.488)
        views = [Renderer(scene_of(corners)).render(CAMERA, NORTHWARD, a) for a in (False, True)]
        np.testing.assert_array_equal(views[0].depth_m, views[1].depth_m)

    def test_averages_a_texture_over_one_pixel_once(self):
        texture = checkerboard(8)
        plain, smooth = (
            picture(wall(3.0, 2.0, 2.0), uv=WALL_UV, texture=texture, antialias=a)
            for a in (False, True)
        )
        x, y = np.moveaxis(CAMERA.grid() - [CAMERA.cx, CAMERA.cy], -1, 0)
        one_triangle = (np.abs(x) < 20) & (np.abs(y) < 20) & (np.abs(x - y) > 1.5)
        # the samples' mean is the pixel's centre, so the colour is the same but for rounding
        assert np.abs(plain - smooth)[one_triangle].max() <= 1
