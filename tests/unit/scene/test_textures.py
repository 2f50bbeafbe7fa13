import cv2
import numpy as np
import pytest

from dfvs_core.errors import ImageError
from dfvs_rooms.surfaces import patterns, textures
from dfvs_rooms.surfaces.materials import room_materials
from dfvs_sim.scene.texture import (
    MAX_LEVELS,
    Texture,
    Wrap,
    linear_from_srgb,
    mip_pyramid,
    pack_textures,
    srgb_from_linear,
)


class TestMipPyramids:
    def test_keep_the_mean_light_at_every_level(self, rng):
        image = rng.integers(0, 256, (64, 32, 3), dtype=np.uint8)
        levels = mip_pyramid(image)
        assert [level.shape[:2] for level in levels][:3] == [(64, 32), (32, 16), (16, 8)]
        assert levels[-1].shape[:2] == (1, 1)
        mean = linear_from_srgb(image / 255.0).mean(axis=(0, 1))
        for level in levels:
            # half a grey level of rounding is at most 0.005 of the light
            light = linear_from_srgb(level / 255.0).mean(axis=(0, 1))
            np.testing.assert_allclose(light, mean, atol=0.005)

    def test_of_odd_sizes_end_at_one_texel(self):
        assert mip_pyramid(np.zeros((5, 300, 3), np.uint8))[-1].shape == (1, 1, 3)

    def test_are_found_again_in_the_pack(self, rng):
        images = [rng.integers(0, 256, (8, 4, 3), dtype=np.uint8) for _ in range(3)]
        pack = pack_textures([Texture(image, Wrap.CLAMP) for image in images])
        for k, image in enumerate(images):
            first, width, height, wrap_u, wrap_v = pack.levels[k, 0]
            assert (width, height, wrap_u, wrap_v) == (4, 8, Wrap.CLAMP, Wrap.REPEAT)
            texels = pack.texels[3 * first : 3 * (first + width * height)]
            np.testing.assert_array_equal(texels.reshape(8, 4, 3), image)
            assert pack.levels[k, MAX_LEVELS - 1, 1:3].tolist() == [1, 1]


def test_srgb_and_linear_light_are_inverse():
    codes = np.arange(256, dtype=np.float32) / 255.0
    np.testing.assert_allclose(srgb_from_linear(linear_from_srgb(codes)), codes, atol=1e-6)
    assert linear_from_srgb(np.array([0.5])) == pytest.approx(0.2140, abs=1e-4)


def test_a_texture_is_rgb():
    with pytest.raises(ImageError, match="uint8 of"):
        Texture(np.zeros((4, 4), np.uint8))


class TestMaterials:
    @pytest.mark.parametrize(
        "draw",
        [
            lambda rng: textures.plaster(rng, (0.9, 0.9, 0.8)),
            textures.bricks,
            textures.planks,
            lambda rng: textures.wood(rng, textures.OAK),
            lambda rng: textures.cloth(rng, (0.2, 0.4, 0.5)),
            lambda rng: patterns.wallpaper(rng, (0.7, 0.7, 0.7), (0.4, 0.5, 0.5)),
        ],
    )
    def test_repeat_without_a_seam(self, draw, rng):
        image = draw(rng)
        for axis in (0, 1):
            # texture is rough everywhere: the seam may not be rougher than the roughest line
            steps = np.abs(np.diff(image, axis=axis)).mean(axis=(1 - axis, 2))
            seam = np.abs(np.take(image, 0, axis) - np.take(image, -1, axis)).mean()
            assert seam <= 1.25 * steps.max()

    def test_come_from_the_seed_alone(self):
        seeds = (5, 5, 6)
        first, again, other = (textures.bricks(np.random.default_rng(seed)) for seed in seeds)
        np.testing.assert_array_equal(first, again)
        assert (first != other).any()

    def test_have_detail_for_features_to_hold_on_to(self):
        materials = room_materials(np.random.default_rng(5))
        for name in ("plaster", "ceiling", "wallpaper", "bricks", "planks", "rug", "sofa"):
            grey = materials[name].image.mean(axis=2)
            # detail within a thirtieth of the picture, 2 grey levels: above a camera's noise
            # of one or two levels once averaged over a feature's pixels
            assert (grey - cv2.blur(grey, (grey.shape[0] // 30,) * 2)).std() > 2.0, name
