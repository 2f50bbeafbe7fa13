"""Sun and sky on a floor, with and without something in the way."""

import numpy as np
import pytest

from dfvs_rooms.generator.room import Sky
from dfvs_rooms.generator.solids import box, panel
from dfvs_rooms.lighting.daylight import sky_irradiance
from dfvs_rooms.lighting.fast import blockers
from dfvs_sim.scene.frames import ned_from_room

# the sun stands in the south, 45 degrees high
SKY = Sky(-90.0, 45.0, sun_irradiance=(10.0, 9.0, 8.0), radiance=(1.0, 2.0, 3.0))
FLOOR = panel((-3, -3, 0), (6, 0, 0), (0, 6, 0), "floor", edge_m=0.25)


def light_on_floor(*parts):
    """Irradiance (rows, columns, 3) on the floor, rows to the north, with parts in the way."""
    points = ned_from_room(FLOOR.vertices + np.array([0.0, 0.0, 0.012]))
    place, rng = (points, ned_from_room(FLOOR.normals)), np.random.default_rng(1)
    return sky_irradiance(SKY, *place, blockers([FLOOR, *parts]), rng).reshape(25, 25, 3)


def test_an_open_floor_gets_all_of_the_sun_and_of_the_sky():
    expected = np.sin(np.radians(45.0)) * np.array([10.0, 9.0, 8.0]) + np.pi * np.array([1, 2, 3])
    # the sun's disc is drawn from four points, and light on the border may be lost
    np.testing.assert_allclose(light_on_floor()[1:-1, 1:-1].mean(axis=(0, 1)), expected, rtol=0.02)


def test_a_wall_throws_a_shadow_away_from_the_sun_as_long_as_it_is_high():
    wall = box((4.0, 0.2, 1.5), (0.0, 0.0, 0.0), "wall")
    light, column = light_on_floor(*wall)[:, 12, 0], np.linspace(-3, 3, 25)
    shade = light[(column > 0.35) & (column < 1.35)]
    assert (shade < np.pi).all()
    assert (shade > 0.4 * np.pi).all()
    for sunny in (
        light[(column > 1.85) & (column < 2.9)],
        light[(column > -2.9) & (column < -0.35)],
    ):
        assert (sunny > 0.7 * 10.0).all()


def test_what_turns_away_from_the_sky_stays_dark():
    ceiling = panel((-3, 3, 0), (6, 0, 0), (0, -6, 0), "ceiling")
    place = (ned_from_room(ceiling.vertices), ned_from_room(ceiling.normals))
    light = sky_irradiance(SKY, *place, blockers([ceiling]), np.random.default_rng(1))
    assert light.max() == pytest.approx(0.0)
