"""Places drawn from seeds: what must hold of every one."""

import functools
import itertools
from dataclasses import replace

import cv2
import numpy as np
import pytest

from dfvs_core.geometry.camera import CameraModel
from dfvs_core.geometry.poses import make_pose
from dfvs_rooms.fittings.natural import natural_materials
from dfvs_rooms.generator.room import Room
from dfvs_rooms.generator.solids import joined
from dfvs_rooms.lighting.bake import lit_scene
from dfvs_rooms.room_types.room_types import PLACES, REPETITIVE_PLACES, ROOM_KINDS, room_of_kind
from dfvs_rooms.surfaces.materials import kind_of
from dfvs_sim.render.renderer import Renderer
from dfvs_sim.scene.frames import ned_from_room
from dfvs_sim.viewpoints.free_space import CUBE_FACES, FreeSpace
from dfvs_sim.viewpoints.poses import camera_pose
from dfvs_sim.viewpoints.sampling import floor_of

SEED = 3
CENTREPIECES = {
    "kitchen": {"worktop", "subway", "steel", "label"},
    "bedroom": {"wallpaper", "rug", "drape", "wainscot"},
    "library": {"books", "parquet", "chart", "leather"},
    "office": {"whiteboard", "noticeboard", "screen", "files"},
    "passage": {"noticeboard", "pane", "red", "subway"},
    "canteen": {"menu", "worktop", "wainscot", "bricks"},
    "workshop": {"pegboard", "chipboard", "red", "drawing"},
    "gallery": {"picture", "concrete", "leather", "bricks"},
    "courtyard": {"sky", "flagstone", "leaf", "roof"},
    "arcade": {"books", "picture", "poster", "subway"},
}
ALL_PLACES = PLACES | REPETITIVE_PLACES
REACHING_OUT = {"sky", "roof", "leaf", "fern", "rubber"}
CAMERA = CameraModel.from_horizontal_fov(160, 120, np.radians(90.0))


@functools.cache
def place(kind):
    return ALL_PLACES[kind](np.random.default_rng(SEED))


@functools.cache
def materials():
    """One material of every kind that any place is of."""
    names = {kind_of(part.material) for kind in ALL_PLACES for part in place(kind).parts}
    return natural_materials(names, np.random.default_rng(1))


@functools.cache
def seen(kind):
    """The place with its materials in even light."""
    parts = [replace(p, material=kind_of(p.material)) for p in place(kind).parts]
    room = Room(tuple(joined(parts)), materials(), sky=place(kind).sky)
    return Renderer(lit_scene(room, [np.full_like(part.vertices, 1.0) for part in room.parts]))


@functools.cache
def free_points(kind):
    """Six points at flying heights with 0.4 m of free space around them, NED."""
    floor_m, low, high = floor_of(seen(kind).scene)
    rng, space = np.random.default_rng(2), FreeSpace(seen(kind))
    lowest, highest = [*low, floor_m - 2.0], [*high, floor_m - 0.8]
    drawn = (rng.uniform(lowest, highest) for _ in range(72))
    free = (point for point in drawn if space.clearance_m(point) > 0.4)
    return list(itertools.islice(free, 6))


@pytest.mark.parametrize("kind", ALL_PLACES)
class TestEveryPlace:
    def test_is_decided_by_its_seed(self, kind):
        again = ALL_PLACES[kind](np.random.default_rng(SEED))
        assert len(again.parts) == len(place(kind).parts)
        for one, same in zip(place(kind).parts, again.parts, strict=True):
            np.testing.assert_array_equal(one.vertices, same.vertices)

    def test_is_lit_and_light_enough_to_draw(self, kind):
        parts, sky = place(kind).parts, place(kind).sky
        assert any(part.emission > 0 for part in parts) or sky is not None
        assert sum(len(part.triangles) for part in parts) < 160_000
        assert (sky is not None) == (kind == "courtyard")

    def test_has_what_it_is_known_by(self, kind):
        assert CENTREPIECES[kind] <= {kind_of(part.material) for part in place(kind).parts}

    def test_stays_inside_its_walls(self, kind):
        layout = place(kind)
        solid = [p for p in layout.parts if kind_of(p.material) not in REACHING_OUT]
        points = np.concatenate([part.vertices for part in solid])
        assert (np.abs(points[:, :2]) <= layout.half + 2e-3).all()
        # the rims of legs that lean dip into the floor
        assert points[:, 2].min() >= -0.03
        assert points[:, 2].max() <= layout.height_m + 1e-6

    def test_has_free_space_from_where_walls_are_seen_all_around(self, kind):
        points = free_points(kind)
        assert len(points) == 6
        for point in points[:2]:
            for R in CUBE_FACES:
                assert (seen(kind).depth(CAMERA, make_pose(R, point)) > 0).all()

    def test_has_texture_in_most_directions(self, kind):
        sift = cv2.SIFT.create()
        points = free_points(kind)
        yaws = np.linspace(0.0, 2 * np.pi, len(points), endpoint=False)
        counts = []
        for point, yaw in zip(points, yaws, strict=True):
            image = seen(kind).render(CAMERA, camera_pose(tuple(point), float(yaw))).image
            counts.append(len(sift.detect(cv2.cvtColor(image, cv2.COLOR_RGB2GRAY), None)))
        # of 160 x 120 px; a blank wall has none
        assert np.median(counts) > 40


def test_a_repetitive_place_is_drawn_by_name_alone():
    assert not set(REPETITIVE_PLACES) & set(ROOM_KINDS)
    assert room_of_kind("arcade", SEED).parts


def test_all_places_can_be_asked_for_by_name():
    assert set(PLACES) < set(ROOM_KINDS)
    assert len(PLACES) == 9


@pytest.mark.parametrize("seed", [0, 4, 7])
def test_tools_hang_over_the_bench_however_high_things_stand_on_it(seed):
    parts = PLACES["workshop"](np.random.default_rng(seed)).parts
    assert "pegboard" in {part.material for part in parts}


def test_two_seeds_make_two_kitchens():
    other = PLACES["kitchen"](np.random.default_rng(SEED + 1))
    assert not np.array_equal(other.half, place("kitchen").half)


def test_no_material_is_blank():
    for name, material in materials().items():
        if name != "globe":
            assert material.image.std(axis=(0, 1)).max() > 0.5, name


def test_the_sky_is_above_and_the_sun_shines_down():
    courtyard = place("courtyard")
    assert courtyard.sky.to_sun[2] > 0.6
    assert ned_from_room(courtyard.sky.to_sun)[2] < -0.6
    dome = next(part for part in courtyard.parts if part.material == "sky")
    assert dome.vertices[:, 2].max() > 2 * courtyard.height_m
