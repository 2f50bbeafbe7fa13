"""What the generator builds, and the light that the tracer measures in it."""

from dataclasses import replace

import numpy as np
import pytest

from dfvs_rooms.generator.furniture import armchair, bookcase, chair, sideboard, table
from dfvs_rooms.generator.props import curtain, framed_artwork, palm
from dfvs_rooms.generator.room import Room
from dfvs_rooms.generator.solids import box, cushion, disc, lathe, panel, sphere, tube
from dfvs_rooms.lighting.bake import exposed, filled, smoothed
from dfvs_rooms.lighting.path_traced import BakeSettings, measure_irradiance
from dfvs_rooms.room_types.living_room import HEIGHT_M, LENGTH_M, WIDTH_M, room_parts
from dfvs_rooms.surfaces.materials import Material

_FOOT_M = 1e-3  # a leg that leans dips its rim into the floor by less than a millimetre


@pytest.fixture(scope="module")
def parts():
    return room_parts(np.random.default_rng(7))


def face_normals(part):
    a, b, c = (part.vertices[part.triangles[:, k]] for k in range(3))
    return np.cross(b - a, c - a)


class TestShapes:
    @pytest.mark.parametrize(
        "part",
        [
            panel((0, 0, 0), (1, 0, 0), (0, 0, 2), "oak"),
            *box((1, 2, 3), (0, 0, 0), "oak"),
            *cushion((0.5, 0.4, 0.2), (0, 0, 0), "oak"),
            sphere(0.3, (1, 2, 3), "oak"),
            disc(0.3, (1, 2, 3), "oak"),
            tube((0, 0, 0), (1, 1, 1), (0.1, 0.05), "oak"),
            lathe([(0.1, 0.0), (0.2, 0.3), (0.1, 0.5)], "oak"),
        ],
    )
    def test_wind_their_triangles_about_their_outward_normals(self, part):
        faces = face_normals(part)
        mean = part.normals[part.triangles].mean(axis=1)
        area = np.linalg.norm(faces, axis=1)
        solid = area > 1e-9
        cosine = np.einsum("mk,mk->m", faces, mean)[solid] / area[solid]
        # coarse roundings turn away from their smooth normals by up to 45 degrees
        assert (cosine > 0.7).all()

    def test_of_a_box_face_away_from_its_middle(self):
        for part in box((1, 2, 3), (4, 5, 6), "oak"):
            outward = part.vertices - [4, 5, 7.5]
            assert (np.einsum("nk,nk->n", outward, part.normals) > 0).all()

    def test_of_a_cushion_stay_within_its_size(self):
        points = np.concatenate([p.vertices for p in cushion((0.6, 0.4, 0.2), (0, 0, 1), "oak")])
        assert (np.abs(points - [0, 0, 1.1]) <= [0.3 + 1e-9, 0.2 + 1e-9, 0.1 + 1e-9]).all()

    def test_are_fine_enough_to_hold_shadows(self):
        part = panel((0, 0, 0), (1, 0, 0), (0, 1, 0), "oak", edge_m=0.1)
        corners = part.vertices[part.triangles]
        sides = np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2)
        assert sides.max() <= 0.1 * np.sqrt(2) + 1e-9


class TestFurniture:
    def test_stands_on_the_floor(self, rng):
        for parts in (
            table((1.2, 0.8, 0.75), "oak", "oak"),
            chair("linen"),
            armchair("sofa", "ikat"),
            bookcase(rng, (1.0, 0.3, 2.0)),
            sideboard((1.5, 0.4, 0.8)),
            palm(rng, 0.5),
        ):
            lowest = min(part.vertices[:, 2].min() for part in parts)
            assert lowest == pytest.approx(0.0, abs=_FOOT_M)

    def test_hangs_in_front_of_the_wall(self, rng):
        parts = framed_artwork(0.6, 0.4, "city", "oak")
        assert max(part.vertices[:, 1].max() for part in parts) <= 1e-9
        (sheet,) = curtain(rng, 0.6, 2.4)
        assert sheet.is_sheet


class TestTheRoom:
    def test_keeps_its_things_inside_its_walls(self, parts):
        for part in parts:
            if part.material == "garden":
                continue
            east, north, up = np.abs(part.vertices).max(axis=0)
            assert east <= LENGTH_M / 2 + 1e-9
            assert north <= WIDTH_M / 2 + 0.3  # the window's reveal
            assert up <= HEIGHT_M + 1e-9
            assert part.vertices[:, 2].min() >= -_FOOT_M

    def test_leaves_the_air_in_the_middle_free(self, parts):
        points = np.concatenate([part.vertices for part in parts])
        middle = (np.abs(points[:, 0] - 0.1) < 1.3) & (np.abs(points[:, 1] - 0.3) < 1.6)
        airspace = middle & (points[:, 2] > 0.75) & (points[:, 2] < 2.0)
        assert not airspace.any()

    def test_stays_light_enough_to_draw(self, parts):
        assert sum(len(part.triangles) for part in parts) < 120_000


class TestLight:
    def test_of_a_ball_falls_off_as_theory_says(self):
        pytest.importorskip("mitsuba", reason="needs the extra [bake]")
        floor = panel((-1, -1, 0), (2, 0, 0), (0, 2, 0), "floor", edge_m=0.08)
        lamp = replace(sphere(0.1, (0, 0, 1.5), "globe"), emission=1.0)
        grey = np.full((4, 4, 3), 128, np.uint8)
        room = Room((floor, lamp), {"floor": Material(grey), "globe": Material(grey, shines=True)})
        settings = BakeSettings(samples=256)
        light = measure_irradiance(room, settings, lambda done, total: None)[0]
        distance = np.linalg.norm(floor.vertices - [0, 0, 1.5], axis=1)
        shape = 1.5 / distance**3  # cosine over distance squared
        inner = np.abs(floor.vertices[:, :2]).max(axis=1) < 0.9  # borders are measured inwards
        ratio = light[inner, 0] / shape[inner]
        # direct light needs few samples: what is left is the plates' and meters' own error
        assert ratio.std() / ratio.mean() < 0.03
        # a ball of radiance L and radius r gives pi L r^2 cos / d^2; L is that of a lamp
        assert ratio.mean() == pytest.approx(np.pi * 7.0 * (0.98 * 0.1) ** 2, rel=0.04)

    def test_inside_other_things_is_taken_from_the_neighbours(self):
        part = panel((0, 0, 0), (1, 0, 0), (0, 1, 0), "oak", edge_m=0.25)
        light = np.full((len(part.vertices), 3), 2.0)
        hidden = np.linalg.norm(part.vertices - [0.5, 0.5, 0.0], axis=1) < 0.3
        light[hidden] = 0.0
        np.testing.assert_allclose(filled(part, light), 2.0)

    def test_smoothing_takes_out_noise_but_no_shadow(self, rng):
        part = panel((0, 0, 0), (1, 0, 0), (0, 1, 0), "oak", edge_m=0.05)
        shadow = np.where(part.vertices[:, :1] < 0.49, 1.0, 3.0) * np.ones(3)
        noisy = shadow * (1 + 0.04 * rng.normal(size=(len(shadow), 1)))
        clean = smoothed(part, noisy)
        assert np.abs(clean / shadow - 1).mean() < 0.4 * np.abs(noisy / shadow - 1).mean()


def test_exposure_goes_by_the_walls_that_light_falls_on():
    wall = panel((0, 0, 0), (1, 0, 0), (0, 0, 1), "wall", edge_m=0.1)
    grey = Material(np.full((4, 4, 3), 128, np.uint8))
    room = Room((wall, wall), {"wall": grey}, frozenset(["wall"]))
    lit, hidden = np.full((len(wall.vertices), 3), 2.0), np.zeros((len(wall.vertices), 3))
    brighter = 3.0 * lit
    alone = exposed(room, [lit, lit])[0]
    np.testing.assert_allclose(exposed(room, [lit, hidden])[0], alone)
    np.testing.assert_allclose(exposed(room, [brighter, hidden])[0], alone)
    assert not np.isnan(exposed(room, [hidden, hidden])[0]).any()
