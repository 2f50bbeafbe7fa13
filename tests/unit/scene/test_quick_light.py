"""Quick light against what theory says of lamps, shadows and closed rooms."""

from dataclasses import replace

import numpy as np
import pytest

from dfvs_rooms.generator.room import Opening, Room
from dfvs_rooms.generator.solids import box, panel, sphere
from dfvs_rooms.lighting.bake import light_room
from dfvs_rooms.lighting.fast import fast_irradiance
from dfvs_rooms.lighting.path_traced import LAMP_RADIANCE
from dfvs_rooms.surfaces.materials import Material
from dfvs_sim.scene.texture import linear_from_srgb

GREY = np.full((4, 4, 3), 128, np.uint8)
ALBEDO = float(linear_from_srgb(np.float32([128 / 255]))[0])
MATERIALS = {"grey": Material(GREY), "globe": Material(GREY, shines=True)}
RADIUS_M = 0.1
INTENSITY = np.pi * (0.98 * RADIUS_M) ** 2 * LAMP_RADIANCE[0]


def lamp(*centre):
    return replace(sphere(RADIUS_M, centre, "globe"), emission=1.0)


def floor(edge_m=0.1):
    return panel((-1, -1, 0), (2, 0, 0), (0, 2, 0), "grey", edge_m=edge_m)


def test_of_a_ball_falls_off_as_theory_says():
    light, dark = fast_irradiance(Room((floor(), lamp(0, 0, 1.5)), MATERIALS), seed=0)
    distance = np.linalg.norm(floor().vertices - [0, 0, 1.5], axis=1)
    expected = INTENSITY * 1.5 / distance**3
    # four points stand for the ball, and light is measured 12 mm above the floor
    np.testing.assert_allclose(light[:, 0], expected, rtol=0.04)
    assert (dark == 0).all()


def test_does_not_pass_through_a_board():
    board = panel((-0.4, -0.4, 0.7), (0.8, 0, 0), (0, 0.8, 0), "grey")
    light = fast_irradiance(Room((floor(0.05), board, lamp(0, 0, 1.5)), MATERIALS), seed=0)[0]
    reach = np.abs(floor(0.05).vertices[:, :2]).max(axis=1)
    # the board's shadow ends at 0.4 * 1.5 / 0.8 = 0.75 m, softly: the ball is 0.2 m wide
    assert light[reach < 0.5, 0].max() < 0.02 * light[reach > 0.95, 0].min()
    assert (light[reach > 0.95, 0] > 0).all()


def test_in_a_closed_room_is_what_the_walls_have_not_swallowed():
    inside = []
    for part in box((3.0, 2.0, 2.5), (0, 0, 0), "grey", edge_m=0.12):
        turned = part.triangles[:, ::-1].copy()
        inside.append(replace(part, normals=-part.normals, triangles=turned))
    room = Room((*inside, lamp(0.2, 0.1, 1.6)), MATERIALS)
    light = fast_irradiance(room, seed=0)[:-1]
    total = sum(flux(part, value) for part, value in zip(inside, light, strict=True))
    given = 4 * np.pi * INTENSITY
    assert total == pytest.approx(given / (1 - ALBEDO), rel=0.08)


def flux(part, irradiance):
    a, b, c = (part.vertices[part.triangles[:, k]] for k in range(3))
    area = 0.5 * np.linalg.norm(np.cross(b - a, c - a), axis=1)
    return float(area @ irradiance[part.triangles].mean(axis=1)[:, 0])


def test_of_a_window_falls_into_the_room_and_not_behind_it():
    window = Opening((0.0, 0.3, 0.6), 0.0, (0.6, 0.6))
    light = fast_irradiance(Room((floor(),), MATERIALS, openings=(window,)), seed=0)[0]
    north = floor().vertices[:, 1]
    assert (light[north > 0.31] == 0).all()
    assert light[(north < 0.2) & (north > -0.4)].min() > 0.1


def test_makes_a_scene_that_repeats_to_the_last_bit():
    room = Room((floor(), lamp(0, 0, 1.5)), MATERIALS)
    one, same = (light_room(room, seed=3) for _ in range(2))
    np.testing.assert_array_equal(one.colours, same.colours)
    assert one.vertices[:, 2].max() == 0.0  # the floor: down is positive
    assert one.vertices[:, 2].min() == pytest.approx(-1.6)
